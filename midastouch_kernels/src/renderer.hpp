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

    static constexpr double kNear = 1e-3;  // m, the camera's near plane

    int height() const { return static_cast<int>(gel_depth_.shape(0)); }
    int width() const { return static_cast<int>(gel_depth_.shape(1)); }
    std::size_t faces() const { return grid_->faces(); }
    double margin() const { return margin_; }
    double gel_distance() const { return distance_; }
    double focal() const { return focal_; }
    const double* corners(int32_t face) const { return grid_->corners(face); }
    const float* gel_depth() const { return gel_depth_.data(); }  // (H, W), margin included
    // Half of what is seen at the margin below the gel, along the image's rows (0) and columns (1).
    double half_extent(int axis) const { return 0.5 * (axis ? height() : width()) / focal_ * (distance_ + margin_); }

    // Draw the pose (4, 4) into `penetration` (H, W), which holds zeros: depth below the gel plus margin; and, unless
    // null, the face seen into `faces` (H, W). `seen` (faces()) remembers under the number `mark` which were drawn.
    void draw(const double* pose, float* penetration, int32_t* faces, std::vector<int32_t>& seen, int32_t mark) const;

    // The same of one triangle.
    void draw_face(int32_t face, const double* pose, float* penetration, int32_t* faces) const;

    // The triangles that may be seen after everything in view has moved by `slack` [m].
    std::vector<int32_t> faces_near(const double* pose, double slack) const;

private:
    struct View;

    template <class Take>
    void visit(const double* pose, double slack, Take&& take) const;

    std::shared_ptr<const TriangleGrid> grid_;
    In<float, -1, -1> gel_depth_;
    double focal_, distance_, margin_;
};
