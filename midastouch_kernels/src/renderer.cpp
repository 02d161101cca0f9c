// Rasterised in homogeneous coordinates (Olano and Greer 1997): no clipping is needed, and the depth at a pixel centre
// is exact. Back faces are culled, as TACTO does.
#include "renderer.hpp"

#include "parallel.hpp"

#include <nanobind/stl/shared_ptr.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace {

constexpr double kOnEdge = 1e-9;          // pixels, an edge that passes so close to a pixel's centre covers it
constexpr float kSlack = 2e-6f;           // m, more than single precision loses on an object of 2 m
constexpr std::size_t kWorthThreads = 8;  // poses; fewer are drawn sooner than threads are started

// Corners (3, 3) in camera coordinates (x right, y up, depth forward) into q; returns the smallest depth.
double to_camera(const double* corners, const double* pose, double distance, double (*q)[3]) {
    double nearest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
        const double dx = corners[3 * k] - pose[3], dy = corners[3 * k + 1] - pose[7],
                     dz = corners[3 * k + 2] - pose[11];
        q[k][0] = pose[0] * dx + pose[4] * dy + pose[8] * dz;
        q[k][1] = pose[1] * dx + pose[5] * dy + pose[9] * dz;
        q[k][2] = distance - (pose[2] * dx + pose[6] * dy + pose[10] * dz);
        nearest = std::min(nearest, q[k][2]);
    }
    return nearest;
}

// Edge functions: edge[k] . (tx, ty, 1) >= 0 inside a front-facing triangle; returns det(q).
double edge_functions(const double (*q)[3], double (*edge)[3]) {
    for (int k = 0; k < 3; ++k) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        edge[k][0] = q[a][1] * q[b][2] - q[a][2] * q[b][1];
        edge[k][1] = q[a][2] * q[b][0] - q[a][0] * q[b][2];
        edge[k][2] = q[a][0] * q[b][1] - q[a][1] * q[b][0];
    }
    return q[0][0] * edge[0][0] + q[0][1] * edge[0][1] + q[0][2] * edge[0][2];
}

}  // namespace

Scene::Scene(std::shared_ptr<const TriangleGrid> grid, In<float, -1, -1> gel_depth, double focal, double gel_distance,
             double margin)
    : grid_(std::move(grid)), gel_depth_(gel_depth), focal_(focal), distance_(gel_distance), margin_(margin) {
    if (!(focal > 0)) throw nb::value_error("a camera needs a focal length");
}

// What the camera of a pose sees, in single precision: for leaving out most triangles before they are transformed.
struct Scene::View {
    float camera[3], right[3], up[3], back[3];  // position and axes, object frame
    float slope_x, slope_y, deepest;            // edges of the image and of the gel's reach
    float per_x, per_y;                         // distance to a side plane over its function's value

    View(const Scene& scene, const double* pose) {
        for (int k = 0; k < 3; ++k) {
            const double* row = pose + 4 * k;
            camera[k] = static_cast<float>(row[3] + row[2] * scene.distance_);
            right[k] = static_cast<float>(row[0]), up[k] = static_cast<float>(row[1]);
            back[k] = static_cast<float>(row[2]);
        }
        slope_x = static_cast<float>(0.5 * scene.width() / scene.focal_);
        slope_y = static_cast<float>(0.5 * scene.height() / scene.focal_);
        per_x = std::sqrt(1 + slope_x * slope_x), per_y = std::sqrt(1 + slope_y * slope_y);
        deepest = static_cast<float>(scene.distance_ + scene.margin_);
    }

    bool misses(const TriangleGrid::Ball& ball, float slack) const {
        const float x = ball.x - camera[0], y = ball.y - camera[1], z = ball.z - camera[2];
        const float radius = ball.radius + slack;
        const float depth = -(back[0] * x + back[1] * y + back[2] * z);
        const bool behind = ball.nx * x + ball.ny * y + ball.nz * z > slack;  // seen from there
        const bool below = depth - radius >= deepest;
        const bool beside = std::abs(right[0] * x + right[1] * y + right[2] * z) > slope_x * depth + per_x * radius;
        const bool above = std::abs(up[0] * x + up[1] * y + up[2] * z) > slope_y * depth + per_y * radius;
        return behind | below | beside | above;  // nobody could predict branches
    }
};

template <class Take>
void Scene::visit(const double* pose, double slack, Take&& take) const {
    // the view frustum down to `margin` below the gel, as a box in the gel frame
    const TriangleGrid& grid = *grid_;
    const View view(*this, pose);
    const double half[3] = {half_extent(0) + slack, half_extent(1) + slack, 0.5 * (distance_ + margin_) + slack};
    const double middle = 0.5 * (distance_ - margin_), corner = 0.8661 * grid.cell();
    const float missed = kSlack + static_cast<float>(slack);
    int64_t low[3], high[3];
    for (int k = 0; k < 3; ++k) {
        const double* row = pose + 4 * k;
        const double centre = row[3] + row[2] * middle;
        const double reach = std::abs(row[0]) * half[0] + std::abs(row[1]) * half[1] + std::abs(row[2]) * half[2];
        low[k] = grid.first(k, centre - reach), high[k] = grid.last(k, centre + reach);
    }
    for (int64_t x = low[0]; x <= high[0]; ++x) {
        const double dx = grid.edge(0, x) + 0.5 * grid.cell() - pose[3];
        for (int64_t y = low[1]; y <= high[1]; ++y) {
            const double dy = grid.edge(1, y) + 0.5 * grid.cell() - pose[7];
            for (int64_t z = low[2]; z <= high[2]; ++z) {
                const auto cell = grid.faces_in(x, y, z);
                if (cell.empty()) continue;
                const double dz = grid.edge(2, z) + 0.5 * grid.cell() - pose[11];
                if (std::abs(pose[0] * dx + pose[4] * dy + pose[8] * dz) > half[0] + corner) continue;
                if (std::abs(pose[1] * dx + pose[5] * dy + pose[9] * dz) > half[1] + corner) continue;
                if (std::abs(pose[2] * dx + pose[6] * dy + pose[10] * dz - middle) > half[2] + corner) continue;
                for (const int32_t face : cell) {
                    take(face, [&] { return view.misses(grid.ball(face), missed); });
                }
            }
        }
    }
}

void Scene::draw(const double* pose, float* penetration, int32_t* faces, std::vector<int32_t>& seen,
                 int32_t mark) const {
    visit(pose, 0, [&](int32_t face, auto missed) {
        if (seen[face] == mark) return;
        seen[face] = mark;
        if (!missed()) draw_face(face, pose, penetration, faces);
    });
}

std::vector<int32_t> Scene::faces_near(const double* pose, double slack) const {
    std::vector<uint8_t> left_out(faces());  // taken or missed already
    std::vector<int32_t> near(1);
    std::size_t count = 0;
    visit(pose, slack, [&](int32_t face, auto missed) {
        if (count == near.size()) near.resize(2 * count);
        near[count] = face;
        count += !left_out[face] & !missed();
        left_out[face] = true;
    });
    near.resize(count);
    return near;
}

void Scene::draw_face(int32_t face, const double* pose, float* penetration, int32_t* faces) const {
    double q[3][3], edge[3][3];
    const double nearest = to_camera(corners(face), pose, distance_, q);
    if (nearest >= distance_ + margin_) return;  // below the gel's apex plane: out of view
    int left = 0, right = width() - 1, top = 0, bottom = height() - 1;
    const double middle_u = 0.5 * width() - 0.5, middle_v = 0.5 * height() - 0.5;
    if (nearest > kNear) {
        double u_min = INFINITY, v_min = INFINITY, u_max = -INFINITY, v_max = -INFINITY;
        for (int k = 0; k < 3; ++k) {
            const double scale = focal_ / q[k][2];
            const double u = q[k][0] * scale + middle_u, v = -q[k][1] * scale + middle_v;
            u_min = std::min(u_min, u), u_max = std::max(u_max, u);
            v_min = std::min(v_min, v), v_max = std::max(v_max, v);
        }
        // the pixel centres within: many a small triangle has none
        if (!(u_max >= left && v_max >= top && u_min <= right && v_min <= bottom)) return;
        left = std::max(left, static_cast<int>(std::ceil(u_min - kOnEdge)));
        right = std::min(right, static_cast<int>(std::floor(u_max + kOnEdge)));
        top = std::max(top, static_cast<int>(std::ceil(v_min - kOnEdge)));
        bottom = std::min(bottom, static_cast<int>(std::floor(v_max + kOnEdge)));
        if (left > right || top > bottom) return;
    }
    const double determinant = edge_functions(q, edge);
    if (!(determinant > 0)) return;  // seen from behind, or edge-on
    const double step = 1 / focal_;
    const double total[3] = {edge[0][0] + edge[1][0] + edge[2][0], edge[0][1] + edge[1][1] + edge[2][1],
                             edge[0][2] + edge[1][2] + edge[2][2]};
    const double per_determinant = 1 / determinant;
    const float slope_of_inverse = static_cast<float>(total[0] * step * per_determinant);
    double slope[3], per_slope[3];
    for (int k = 0; k < 3; ++k) slope[k] = edge[k][0] * step, per_slope[k] = 1 / slope[k];
    // each row's span where all three edge functions, linear in the column, are not negative
    for (int v = top; v <= bottom; ++v) {
        const double ty = (middle_v - v) * step;
        double first = left, last = right;
        for (int k = 0; k < 3; ++k) {
            const double value = edge[k][1] * ty + edge[k][2] - slope[k] * middle_u;
            if (slope[k] > 0)
                first = std::max(first, -value * per_slope[k] - kOnEdge);
            else if (slope[k] < 0)
                last = std::min(last, -value * per_slope[k] + kOnEdge);
            else if (value < 0)
                last = -1;
        }
        if (last < first) continue;
        const int begin = static_cast<int>(std::ceil(first)), end = static_cast<int>(std::floor(last)) + 1;
        if (begin >= end) continue;
        // 1 / depth is linear in the column: counted from the span's first, single precision errs by nanometres
        const float at_begin =
            static_cast<float>((total[1] * ty + total[2] + total[0] * (begin - middle_u) * step) * per_determinant);
        float* row = penetration + v * width() + begin;
        const float* gel = gel_depth_.data() + v * width() + begin;
        if (faces) {
            int32_t* owner = faces + v * width() + begin;
            for (int u = 0; u < end - begin; ++u) {
                const float depth = 1 / (at_begin + slope_of_inverse * static_cast<float>(u)), sunk = gel[u] - depth;
                if (depth > static_cast<float>(kNear) && sunk > row[u]) row[u] = sunk, owner[u] = face;
            }
        } else {
            for (int u = 0; u < end - begin; ++u) {
                const float depth = 1 / (at_begin + slope_of_inverse * static_cast<float>(u)), sunk = gel[u] - depth;
                row[u] = depth > static_cast<float>(kNear) && sunk > row[u] ? sunk : row[u];
            }
        }
    }
}

namespace {

void render(const Scene& scene, In<double, -1, 4, 4> poses, InOut<float, -1, -1, -1> penetration,
            InOut<int32_t, -1, -1, -1> faces) {
    const std::size_t n = poses.shape(0), pixels = static_cast<std::size_t>(scene.height()) * scene.width();
    const bool with_faces = faces.size() > 0;
    if (penetration.size() != n * pixels || (with_faces && faces.size() != n * pixels))
        throw nb::value_error("penetration and faces must hold a map for each pose");
    nb::gil_scoped_release released;
    auto render_range = [&](std::size_t first, std::size_t last) {
        std::vector<int32_t> seen(scene.faces(), -1);
        for (std::size_t i = first; i < last; ++i)
            scene.draw(poses.data() + 16 * i, penetration.data() + i * pixels,
                       with_faces ? faces.data() + i * pixels : nullptr, seen, static_cast<int32_t>(i));
    };
    if (n < kWorthThreads)
        render_range(0, n);
    else
        parallel_for(n, 16, render_range);
}

Out<float> interpolate_normals(const Scene& scene, In<double, -1, 4, 4> poses, In<int32_t, -1, -1, -1> faces,
                               In<double, -1, 3, 3> corner_normals, In<double, -1, -1> tangent_x,
                               In<double, -1, -1> tangent_y) {
    const std::size_t n = faces.shape(0), pixels = faces.shape(1) * faces.shape(2);
    if (poses.shape(0) != n || tangent_x.size() != pixels || tangent_y.size() != pixels)
        throw nb::value_error("poses, faces and tangents of different sizes");
    if (corner_normals.shape(0) != scene.faces()) throw nb::value_error("normals are needed for every face");
    for (std::size_t i = 0; i < n * pixels; ++i)
        if (faces.data()[i] >= static_cast<int64_t>(scene.faces())) throw nb::value_error("a face that is not there");
    auto normals = make_array<float>({n, faces.shape(1), faces.shape(2), 3});
    nb::gil_scoped_release released;
    parallel_for(n, 4, [&](std::size_t begin, std::size_t end) {
        double q[3][3], edge[3][3], local[3][3] = {};
        for (std::size_t i = begin; i < end; ++i) {
            const double* pose = poses.data() + 16 * i;
            int32_t current = -1;
            for (std::size_t p = 0; p < pixels; ++p) {
                const int32_t face = faces.data()[i * pixels + p];
                if (face < 0) continue;
                if (face != current) {
                    current = face;
                    to_camera(scene.corners(face), pose, scene.gel_distance(), q);
                    edge_functions(q, edge);
                    const double* normal = corner_normals.data() + 9 * face;
                    for (int a = 0; a < 3; ++a)
                        for (int b = 0; b < 3; ++b)
                            local[a][b] = normal[3 * a] * pose[b] + normal[3 * a + 1] * pose[4 + b] +
                                          normal[3 * a + 2] * pose[8 + b];
                }
                double weight[3], out[3];
                for (int k = 0; k < 3; ++k)
                    weight[k] = edge[k][0] * tangent_x.data()[p] + edge[k][1] * tangent_y.data()[p] + edge[k][2];
                for (int k = 0; k < 3; ++k)
                    out[k] = weight[0] * local[0][k] + weight[1] * local[1][k] + weight[2] * local[2][k];
                const double length = std::sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
                // a triangle's weights are as small as its area squared
                const double scale = 1 / std::max(length, 1e-300);
                for (int k = 0; k < 3; ++k)
                    normals.data()[3 * (i * pixels + p) + k] = static_cast<float>(out[k] * scale);
            }
        }
    });
    return normals;
}

}  // namespace

void bind_renderer(nb::module_& m) {
    nb::class_<Scene>(m, "Scene", "A mesh in its grid of cells, and the sensor that sees it.")
        .def(nb::init<std::shared_ptr<const TriangleGrid>, In<float, -1, -1>, double, double, double>(),
             nb::arg("grid"), named("gel_depth"), nb::arg("focal"), nb::arg("gel_distance"), nb::arg("margin"));
    m.def("render", &render, nb::arg("scene"), named("poses"), named("penetration"), named("faces"),
          "Penetration plus margin (N, H, W) [m] at poses (N, 4, 4) into arrays of zeros, and the faces seen into an "
          "array of -1, or of size 0 if nobody asks.");
    m.def("interpolate_normals", &interpolate_normals, nb::arg("scene"), named("poses"), named("faces"),
          named("corner_normals"), named("tangent_x"), named("tangent_y"),
          "Smooth normals (N, H, W, 3), gel frame, of the faces (N, H, W) seen; 0 where none is.");
}
