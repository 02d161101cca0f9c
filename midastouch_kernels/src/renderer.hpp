// Penetration maps of a mesh pressed into the gel: a z-buffer over the triangles under the sensor's footprint.
#pragma once

#include "arrays.hpp"
#include "triangle_grid.hpp"

#include <cstdint>
#include <vector>

// A mesh in its grid of cells, and the sensor that sees it; keeps both alive.
class Scene {
public:
    Scene(std::shared_ptr<const TriangleGrid> grid, In<float, -1, -1> gel_depth, double focal, double gel_distance,
          double margin);

    int height() const { return static_cast<int>(gel_depth_.shape(0)); }
    int width() const { return static_cast<int>(gel_depth_.shape(1)); }
    std::size_t faces() const { return grid_->faces(); }
    double margin() const { return margin_; }
    double gel_distance() const { return distance_; }
    const double* corners(int32_t face) const { return grid_->corners(face); }

    // Draw the pose (4, 4) into `penetration` (H, W), which holds zeros: depth below the gel plus margin; and, unless
    // null, the face seen into `faces` (H, W). `seen` (faces()) remembers under the number `mark` which were drawn.
    void draw(const double* pose, float* penetration, int32_t* faces, std::vector<int32_t>& seen, int32_t mark) const;

private:
    struct View;

    void draw_face(int32_t face, const double* pose, float* penetration, int32_t* faces) const;

    std::shared_ptr<const TriangleGrid> grid_;
    In<float, -1, -1> gel_depth_;
    double focal_, distance_, margin_;
};
