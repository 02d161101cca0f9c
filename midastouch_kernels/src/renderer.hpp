// Penetration maps of a mesh pressed into the gel: a z-buffer over the triangles under the sensor's footprint.
#pragma once

#include "arrays.hpp"

#include <cstdint>
#include <vector>

// A mesh in its grid of cells, and the sensor that sees it; keeps the arrays it was made of alive.
class Scene {
public:
    Scene(In<double, -1, 3, 3> corners, In<double, 3> origin, double cell, In<int64_t, 3> shape, In<int64_t, -1> start,
          In<int32_t, -1> items, In<float, -1, -1> gel_depth, double focal, double gel_distance, double margin);

    int height() const { return static_cast<int>(gel_depth_.shape(0)); }
    int width() const { return static_cast<int>(gel_depth_.shape(1)); }
    std::size_t faces() const { return corners_.shape(0); }
    double margin() const { return margin_; }
    double gel_distance() const { return distance_; }
    const double* corners(std::size_t face) const { return corners_.data() + 9 * face; }

    // Draw the pose (4, 4) into `penetration` (H, W), which holds zeros: depth below the gel plus margin; and, unless
    // null, the face seen into `faces` (H, W). `seen` (faces()) remembers under the number `mark` which were drawn.
    void draw(const double* pose, float* penetration, int32_t* faces, std::vector<int32_t>& seen, int32_t mark) const;

private:
    void draw_face(int32_t face, const double* pose, float* penetration, int32_t* faces) const;

    In<double, -1, 3, 3> corners_;
    In<int64_t, -1> start_;
    In<int32_t, -1> items_;
    In<float, -1, -1> gel_depth_;
    double origin_[3];
    int64_t shape_[3];
    double cell_, focal_, distance_, margin_;
};
