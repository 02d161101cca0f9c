#include "patch.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace {

constexpr double kSlack = 2e-3;       // m that what is seen may have moved before triangles are gathered anew
constexpr std::size_t kPrefetch = 8;  // triangles ahead whose corners are fetched: they may lie anywhere
constexpr float kOnEdge = 1e-4f;      // pixels, by which triangles overlap: more than single precision loses

Lanes smaller(Lanes a, Lanes b) {
    return a < b ? a : b;
}
Lanes larger(Lanes a, Lanes b) {
    return a > b ? a : b;
}

// The smallest whole number that is not below x, and the largest that is not above; x >= 0.
Mask floor_of(Lanes x) {
    return __builtin_convertvector(x, Mask);
}
Mask ceil_of(Lanes x) {
    const Mask whole = floor_of(x);
    return whole - (__builtin_convertvector(whole, Lanes) < x);  // a true lane is -1
}

Lanes ramp() {
    Lanes out{};
    for (int l = 0; l < kLanes; ++l) out[l] = static_cast<float>(l);
    return out;
}

}  // namespace

// What is drawn of eight triangles: the pixels around each, and what is linear over these, as value at the first pixel
// and steps along columns and rows: 1 / depth, and the edge functions, not negative inside.
struct Patch::Outlines {
    Mask seen, left, right, top, bottom;
    Lanes inverse, inverse_u, inverse_v;
    Lanes edge[3], edge_u[3], edge_v[3];
};

Patch::Patch(const Scene& scene)
    : scene_(scene),
      gel_depth_(scene.gel_depth(), scene.gel_depth() + static_cast<std::size_t>(scene.height()) * scene.width()) {
    gel_depth_.resize(gel_depth_.size() + kLanes);
}

// Whether nothing that is seen, nor the camera, has moved farther than the slack. A rigid motion moves no point of a
// pyramid farther than that of its corners which it moves farthest.
bool Patch::covers(const Transform& pose) const {
    const double x = scene_.half_extent(0), y = scene_.half_extent(1), z = -scene_.margin();
    const double corners[5][3] = {{x, y, z}, {x, -y, z}, {-x, y, z}, {-x, -y, z}, {0, 0, scene_.gel_distance()}};
    return std::all_of(std::begin(corners), std::end(corners), [&](const double* corner) {
        double squared = 0;
        for (int a = 0; a < 3; ++a) {
            double moved = pose[4 * a + 3] - centre_[4 * a + 3];
            for (int b = 0; b < 3; ++b) moved += (pose[4 * a + b] - centre_[4 * a + b]) * corner[b];
            squared += moved * moved;
        }
        return squared <= kSlack * kSlack;
    });
}

void Patch::gather(const Transform& pose) {
    centre_ = pose;
    const std::vector<int32_t> faces = scene_.faces_near(pose.data(), kSlack);
    triangles_.resize((faces.size() + kLanes - 1) / kLanes);
    for (std::size_t i = 0; i < faces.size(); ++i) {
        Triangles& some = triangles_[i / kLanes];
        const std::size_t l = i % kLanes;
        __builtin_prefetch(scene_.corners(faces[std::min(i + kPrefetch, faces.size() - 1)]));
        some.face[l] = faces[i];
        some.count = l + 1;
        const double* corners = scene_.corners(faces[i]);
        for (int k = 0; k < 3; ++k)
            for (int a = 0; a < 3; ++a) some.corner[k][a][l] = static_cast<float>(corners[3 * k + a] - pose[4 * a + 3]);
    }
}

void Patch::draw(const Transform& pose, float* penetration) {
    if (!covers(pose)) gather(pose);
    Transform relative = pose;
    for (int a = 0; a < 3; ++a) relative[4 * a + 3] -= centre_[4 * a + 3];
    relative = inverse(relative);
    float m[12];
    std::copy_n(relative.data(), 12, m);
    const float distance = static_cast<float>(scene_.gel_distance()), focal = static_cast<float>(scene_.focal());
    const float middle_u = 0.5f * (scene_.width() - 1), middle_v = 0.5f * (scene_.height() - 1);
    const float last_u = static_cast<float>(scene_.width() - 1), last_v = static_cast<float>(scene_.height() - 1);
    const float deepest = static_cast<float>(scene_.gel_distance() + scene_.margin());
    const Lanes none{};
    for (const Triangles& some : triangles_) {
        Lanes u[3], v[3], w[3], nearest = all(INFINITY), farthest = all(-INFINITY);
        for (int k = 0; k < 3; ++k) {
            const Lanes x = some.corner[k][0], y = some.corner[k][1], z = some.corner[k][2];
            const Lanes depth = distance - (m[8] * x + m[9] * y + m[10] * z + m[11]);
            w[k] = 1 / depth;
            u[k] = middle_u + focal * w[k] * (m[0] * x + m[1] * y + m[2] * z + m[3]);
            v[k] = middle_v - focal * w[k] * (m[4] * x + m[5] * y + m[6] * z + m[7]);
            nearest = smaller(nearest, depth), farthest = larger(farthest, depth);
        }
        const Lanes u1 = u[1] - u[0], v1 = v[1] - v[0], u2 = u[2] - u[0], v2 = v[2] - v[0];
        const Lanes area = u2 * v1 - u1 * v2;
        const Lanes u_min = smaller(u[0], smaller(u[1], u[2])) - kOnEdge;
        const Lanes u_max = larger(u[0], larger(u[1], u[2])) + kOnEdge;
        const Lanes v_min = smaller(v[0], smaller(v[1], v[2])) - kOnEdge;
        const Lanes v_max = larger(v[0], larger(v[1], v[2])) + kOnEdge;
        const Mask ahead = nearest > static_cast<float>(Scene::kNear);
        Outlines out;
        out.seen = ahead & (nearest < deepest) & (area > 0) & (u_max >= 0) & (v_max >= 0) & (u_min <= last_u) &
                   (v_min <= last_v);
        out.left = ceil_of(out.seen ? larger(u_min, none) : none);
        out.top = ceil_of(out.seen ? larger(v_min, none) : none);
        out.right = floor_of(out.seen ? smaller(u_max, none + last_u) : none);
        out.bottom = floor_of(out.seen ? smaller(v_max, none + last_v) : none);
        out.seen &= (out.left <= out.right) & (out.top <= out.bottom);
        const Mask across = ~ahead & (farthest > static_cast<float>(Scene::kNear));  // through the camera's near plane
        if (any(across))
            for (std::size_t l = 0; l < some.count; ++l)
                if (across[l]) scene_.draw_face(some.face[l], pose.data(), penetration, nullptr);
        if (!any(out.seen)) continue;
        const Lanes first_u = __builtin_convertvector(out.left, Lanes);
        const Lanes first_v = __builtin_convertvector(out.top, Lanes);
        for (int k = 0; k < 3; ++k) {
            const int a = (k + 1) % 3, b = (k + 2) % 3;
            const Lanes du = v[b] - v[a], dv = u[a] - u[b];
            const Lanes tolerance = kOnEdge * (magnitude(du) + magnitude(dv));
            out.edge[k] = du * (first_u - u[a]) + dv * (first_v - v[a]) + tolerance;
            out.edge_u[k] = du, out.edge_v[k] = dv;
        }
        out.inverse_u = ((w[2] - w[0]) * v1 - (w[1] - w[0]) * v2) / area;
        out.inverse_v = ((w[1] - w[0]) * u2 - (w[2] - w[0]) * u1) / area;
        out.inverse = w[0] + out.inverse_u * (first_u - u[0]) + out.inverse_v * (first_v - v[0]);
        for (std::size_t l = 0; l < some.count; ++l)
            if (out.seen[l]) fill(out, l, penetration);
    }
}

void Patch::fill(const Outlines& outlines, std::size_t l, float* penetration) const {
    const int width = scene_.width(), left = outlines.left[l], right = outlines.right[l];
    for (int from = left; from <= right; from += kLanes) {
        const Lanes column = ramp() + static_cast<float>(from - left);
        const Mask within = column <= static_cast<float>(right - left);
        Lanes inverse = outlines.inverse[l] + outlines.inverse_u[l] * column, edge[3];
        for (int k = 0; k < 3; ++k) edge[k] = outlines.edge[k][l] + outlines.edge_u[k][l] * column;
        for (int v = outlines.top[l]; v <= outlines.bottom[l]; ++v) {
            float* row = penetration + v * width + from;
            const Lanes sunk = load(gel_depth_.data() + v * width + from) - 1 / inverse, there = load(row);
            const Mask inside = within & (edge[0] >= 0) & (edge[1] >= 0) & (edge[2] >= 0);
            store(row, inside & (sunk > there) ? sunk : there);
            inverse += outlines.inverse_v[l];
            for (int k = 0; k < 3; ++k) edge[k] += outlines.edge_v[k][l];
        }
    }
}
