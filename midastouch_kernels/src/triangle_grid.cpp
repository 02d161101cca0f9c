// A triangle soup in a uniform grid: which triangles may lie in which cell.
#include "triangle_grid.hpp"

namespace {

constexpr double kMostCells = 1e9;

// Around the centroid; the radius is rounded up, so that the ball holds the triangle whatever is rounded.
TriangleGrid::Ball ball_around(const double* corners) {
    float centre[3];
    double edge[2][3];
    for (int k = 0; k < 3; ++k) {
        centre[k] = static_cast<float>((corners[k] + corners[3 + k] + corners[6 + k]) / 3);
        edge[0][k] = corners[3 + k] - corners[k], edge[1][k] = corners[6 + k] - corners[k];
    }
    double squared = 0;
    for (int i = 0; i < 9; i += 3) {
        const double x = corners[i] - centre[0], y = corners[i + 1] - centre[1], z = corners[i + 2] - centre[2];
        squared = std::max(squared, x * x + y * y + z * z);
    }
    const double nx = edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1];
    const double ny = edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2];
    const double nz = edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0];
    const double length = std::max(std::sqrt(nx * nx + ny * ny + nz * nz), 1e-300);
    const float radius = std::nextafter(static_cast<float>(std::sqrt(squared)), INFINITY);
    return {centre[0],
            centre[1],
            centre[2],
            radius,
            static_cast<float>(nx / length),
            static_cast<float>(ny / length),
            static_cast<float>(nz / length)};
}

}  // namespace

TriangleGrid::TriangleGrid(In<double, -1, 3, 3> corners, double cell)
    : corners_(corners.data(), corners.data() + corners.size()), cell_(cell) {
    const std::size_t n = corners.shape(0);
    if (!n || n > INT32_MAX) throw nb::value_error("a grid needs at least one triangle, and at most 2^31");
    if (!(cell > 0)) throw nb::value_error("the cells of a grid need a size");
    double low[3], high[3], cells = 1;
    for (int k = 0; k < 3; ++k) {
        low[k] = INFINITY, high[k] = -INFINITY;
        for (std::size_t i = k; i < corners_.size(); i += 3) {
            if (!std::isfinite(corners_[i])) throw nb::value_error("a triangle with a non-finite corner");
            low[k] = std::min(low[k], corners_[i]), high[k] = std::max(high[k], corners_[i]);
        }
        origin_[k] = low[k] - 0.5 * cell;
        const double size = std::ceil((high[k] - origin_[k]) / cell) + 1;
        cells *= size;
        if (!(cells < kMostCells)) throw nb::value_error("the cells of the grid are too small for its extent");
        shape_[k] = static_cast<int64_t>(size);
    }
    balls_.reserve(n);
    for (std::size_t f = 0; f < n; ++f) balls_.push_back(ball_around(corners_.data() + 9 * f));

    // calls visit(c) for each cell c that the bounding box of triangle f meets
    auto for_cells = [&](std::size_t f, auto&& visit) {
        int64_t from[3], to[3];
        for (int k = 0; k < 3; ++k) {
            const double* c = corners_.data() + 9 * f + k;
            from[k] = first(k, std::min({c[0], c[3], c[6]}));
            to[k] = last(k, std::max({c[0], c[3], c[6]}));
        }
        for (int64_t x = from[0]; x <= to[0]; ++x)
            for (int64_t y = from[1]; y <= to[1]; ++y)
                for (int64_t z = from[2]; z <= to[2]; ++z) visit((x * shape_[1] + y) * shape_[2] + z);
    };
    start_.resize(shape_[0] * shape_[1] * shape_[2] + 1);
    for (std::size_t f = 0; f < n; ++f) for_cells(f, [&](int64_t c) { ++start_[c + 1]; });
    for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    items_.resize(start_.back());
    std::vector<int64_t> next(start_.begin(), start_.end() - 1);
    for (std::size_t f = 0; f < n; ++f) for_cells(f, [&](int64_t c) { items_[next[c]++] = static_cast<int32_t>(f); });
}

void bind_triangle_grid(nb::module_& m) {
    nb::class_<TriangleGrid>(m, "TriangleGrid", "Triangles (F, 3, 3) [m] in a uniform grid of cells [m].")
        .def(nb::init<In<double, -1, 3, 3>, double>(), named("corners"), nb::arg("cell"));
}
