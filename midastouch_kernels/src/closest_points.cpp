// Exact closest point of a triangle soup. The triangle of a guess bounds the distance; only the grid's cells within that
// bound are searched for a nearer one.
#include "arrays.hpp"
#include "parallel.hpp"
#include "triangle_grid.hpp"

#include <algorithm>
#include <cmath>

namespace {

constexpr std::size_t kPiece = 64;  // points; fewer are answered sooner than a thread is started
constexpr float kSlack = 1e-6f;     // m, more than single precision loses on an object of 2 m

// Closest point of triangle abc (3, 3) to p into `out`; returns the squared distance (Ericson 2005, 5.1.5).
inline double project(const double* p, const double* corners, double* out) {
    const double *a = corners, *b = corners + 3, *c = corners + 6;
    const double ab0 = b[0] - a[0], ab1 = b[1] - a[1], ab2 = b[2] - a[2];
    const double ac0 = c[0] - a[0], ac1 = c[1] - a[1], ac2 = c[2] - a[2];
    const double ap0 = p[0] - a[0], ap1 = p[1] - a[1], ap2 = p[2] - a[2];
    const double d1 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2, d2 = ac0 * ap0 + ac1 * ap1 + ac2 * ap2;
    const double bp0 = p[0] - b[0], bp1 = p[1] - b[1], bp2 = p[2] - b[2];
    const double d3 = ab0 * bp0 + ab1 * bp1 + ab2 * bp2, d4 = ac0 * bp0 + ac1 * bp1 + ac2 * bp2;
    const double cp0 = p[0] - c[0], cp1 = p[1] - c[1], cp2 = p[2] - c[2];
    const double d5 = ab0 * cp0 + ab1 * cp1 + ab2 * cp2, d6 = ac0 * cp0 + ac1 * cp1 + ac2 * cp2;
    const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    double v, w;
    if (d1 <= 0 && d2 <= 0)
        v = 0, w = 0;
    else if (d3 >= 0 && d4 <= d3)
        v = 1, w = 0;
    else if (vc <= 0 && d1 >= 0 && d3 <= 0)
        v = d1 / (d1 - d3), w = 0;
    else if (d6 >= 0 && d5 <= d6)
        v = 0, w = 1;
    else if (vb <= 0 && d2 >= 0 && d6 <= 0)
        v = 0, w = d2 / (d2 - d6);
    else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6)), v = 1 - w;
    else {
        const double total = 1 / (va + vb + vc);
        v = vb * total, w = vc * total;
    }
    double squared = 0;
    const double ab[3] = {ab0, ab1, ab2}, ac[3] = {ac0, ac1, ac2};
    for (int k = 0; k < 3; ++k) {
        out[k] = a[k] + ab[k] * v + ac[k] * w;
        squared += (p[k] - out[k]) * (p[k] - out[k]);
    }
    return squared;
}

// Whether the ball lies farther from p than `reach`.
inline bool beyond(const TriangleGrid::Ball& ball, const float* p, float reach) {
    const float x = ball.x - p[0], y = ball.y - p[1], z = ball.z - p[2], limit = reach + ball.radius;
    return x * x + y * y + z * z > limit * limit;
}

// Closest surface point to p into `closest`, beginning with triangle `best`, which ends as the closest one; the distance.
double search(const TriangleGrid& grid, const double* p, int64_t& best, double* closest) {
    double least = project(p, grid.corners(static_cast<int32_t>(best)), closest);
    const double reach = std::sqrt(least);
    const float rounded[3] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    float limit = static_cast<float>(reach) + kSlack;
    int64_t low[3], high[3];
    for (int k = 0; k < 3; ++k) low[k] = grid.first(k, p[k] - reach), high[k] = grid.last(k, p[k] + reach);
    // square of how far the cells of an index lie from p along an axis
    auto gap = [&](int k, int64_t i) {
        const double edge = grid.edge(k, i), outside = std::max({edge - p[k], p[k] - edge - grid.cell(), 0.0});
        return outside * outside;
    };
    for (int64_t x = low[0]; x <= high[0]; ++x) {
        const double gap_x = gap(0, x);
        if (gap_x > least) continue;
        for (int64_t y = low[1]; y <= high[1]; ++y) {
            const double gap_xy = gap_x + gap(1, y);
            if (gap_xy > least) continue;
            for (int64_t z = low[2]; z <= high[2]; ++z) {
                const auto faces = grid.faces_in(x, y, z);
                if (faces.empty() || gap_xy + gap(2, z) > least) continue;
                for (const int32_t face : faces) {
                    if (beyond(grid.ball(face), rounded, limit)) continue;
                    double candidate[3];
                    const double squared = project(p, grid.corners(face), candidate);
                    if (squared < least) {
                        least = squared, best = face;
                        limit = static_cast<float>(std::sqrt(squared)) + kSlack;
                        std::copy_n(candidate, 3, closest);
                    }
                }
            }
        }
    }
    return std::sqrt(least);
}

nb::tuple closest_points(const TriangleGrid& grid, In<double, -1, 3> points, In<int64_t, -1> guess) {
    const std::size_t n = points.shape(0);
    if (guess.shape(0) != n) throw nb::value_error("points and guess of different sizes");
    auto closest = make_array<double>({n, 3});
    auto distance = make_array<double>({n});
    auto face = make_array<int64_t>({n});
    for (std::size_t i = 0; i < n; ++i) {
        if (guess.data()[i] < 0 || static_cast<std::size_t>(guess.data()[i]) >= grid.faces())
            throw nb::value_error("a guess that is no triangle of the grid");
        face.data()[i] = guess.data()[i];
    }
    {
        nb::gil_scoped_release released;
        parallel_for(n, kPiece, [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last; ++i)
                distance.data()[i] = search(grid, points.data() + 3 * i, face.data()[i], closest.data() + 3 * i);
        });
    }
    return nb::make_tuple(closest, distance, face);
}

}  // namespace

void bind_closest_points(nb::module_& m) {
    m.def("closest_points", &closest_points, nb::arg("grid"), named("points"), named("guess"),
          "Exact nearest surface points of points (N, 3) [m]: closest (N, 3), distance (N,), triangle (N,). The nearer "
          "the triangles of `guess` (N,), the sooner.");
}
