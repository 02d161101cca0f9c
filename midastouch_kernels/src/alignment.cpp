// Alignment of a sensor pose to the penetration map that it feels: Gauss-Newton on the pose's own rendered view.
#include "arrays.hpp"
#include "cholesky.hpp"
#include "lanes.hpp"
#include "patch.hpp"
#include "tangent.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

// m, residual at which a pixel's weight has halved (Geman and McClure 1987), iteration by iteration: wide first, so
// that a start a millimetre off is not all outliers (graduated non-convexity, Blake and Zisserman 1987)
constexpr double kWidths[] = {2e-3, 2e-3, 1e-3, 1e-3, 5e-4, 5e-4, 3e-4, 3e-4};
constexpr int kIterations = std::size(kWidths);
constexpr double kSmallStep[] = {5e-5, 2e-3};  // m, rad: no second iteration at the same width after one this small
constexpr double kNear = 0.9;       // fit at a width, beyond which a second iteration at the same tells no more
constexpr float kSteepest = 3.0f;   // slope beyond which a finite difference across a silhouette says nothing
constexpr double kRotationScale = 0.01;  // m that one radian counts as

// A map (H, W) as single precision, with room behind its end for a whole load.
template <class T>
std::vector<float> padded(const T* map, std::size_t size) {
    std::vector<float> out(size + 2 * kLanes);
    std::copy_n(map, size, out.begin());
    return out;
}

// Robust normal equations in a pose's tangent space, the cost, and the fraction of touched pixels explained.
struct Equations {
    Matrix6 hessian{};
    Vector6 gradient{};
    double cost = 0, fit = 0;
};

class MapAlignment {
public:
    // Tangents and depth of the undeformed gel (H, W); information of one pixel [1 / m^2]; reach, squared Mahalanobis
    // distance from the prior's pose up to which one that has to come down is looked for.
    MapAlignment(const Scene& scene, In<double, -1, -1> tangent_x, In<double, -1, -1> tangent_y,
                 In<double, -1, -1> gel_depth, double information, double reach)
        : scene_(scene),
          pixels_(static_cast<std::size_t>(scene.height()) * scene.width()),
          information_(information),
          reach_(reach) {
        if (tangent_x.size() != pixels_ || tangent_y.size() != pixels_ || gel_depth.size() != pixels_)
            throw nb::value_error("tangents and gel depth of another size than the scene's");
        if (!(scene.margin() > 0)) throw nb::value_error("a scene without a margin: what is about to touch is not seen");
        tangent_x_ = padded(tangent_x.data(), pixels_), tangent_y_ = padded(tangent_y.data(), pixels_);
        gel_depth_ = padded(gel_depth.data(), pixels_);
    }

    nb::tuple align(In<double, 4, 4> pose, In<double, 6, 6> covariance, In<float, -1, -1> map,
                    In<double, 4, 4> start) const {
        if (static_cast<int>(map.shape(0)) != scene_.height() || static_cast<int>(map.shape(1)) != scene_.width())
            throw nb::value_error("a penetration map of another size than the sensor's");
        auto found_pose = make_array<double>({4, 4}), found_covariance = make_array<double>({6, 6});
        double log_evidence, fit;
        {
            nb::gil_scoped_release released;
            Transform centre, state;
            Matrix6 spread;
            std::copy_n(pose.data(), 16, centre.begin());
            std::copy_n(start.data(), 16, state.begin());
            std::copy_n(covariance.data(), 36, spread.begin());
            const Cholesky wide(spread);
            const Matrix6 prior = wide.inverse();
            const Equations at = descend(centre, state, prior, first_width(spread), padded(map.data(), pixels_), true);
            const Cholesky narrow(sum_of(prior, at.hessian));
            log_evidence = -0.5 * (at.cost + narrow.log_determinant() + wide.log_determinant());
            fit = at.fit;
            std::copy_n(state.begin(), 16, found_pose.data());
            std::copy_n(narrow.inverse().begin(), 36, found_covariance.data());
        }
        return nb::make_tuple(found_pose, found_covariance, log_evidence, fit);
    }

private:
    static Matrix6 sum_of(Matrix6 a, const Matrix6& b) {
        for (int i = 0; i < 36; ++i) a[i] += b[i];
        return a;
    }

    // The first width that is needed: residuals are hardly larger than a prior's spread.
    static int first_width(const Matrix6& covariance) {
        double squared = 0;
        for (int i = 0; i < 3; ++i)
            squared += covariance[7 * i] + kRotationScale * kRotationScale * covariance[7 * (i + 3)];
        int first = 0;
        for (int k = 0; k < kIterations; k += 2)
            if (kWidths[k] >= std::sqrt(squared)) first = k;
        return first;
    }

    // Gauss-Newton from `state`, which ends at the optimum; the equations there, the prior's part added to the cost.
    Equations descend(const Transform& centre, Transform& state, const Matrix6& prior, int first,
                      const std::vector<float>& map, bool comes_down) const {
        const Transform start = state;
        const Transform from_centre = inverse(centre);
        std::vector<float> rendered(map.size());
        Patch patch(scene_);
        double settled = INFINITY;
        draw(patch, state, rendered);
        comes_down = comes_down && let_down(patch, state, map, rendered);
        for (int k = first;; ++k) {
            const bool last = k == kIterations;
            const double width = kWidths[std::min(k, kIterations - 1)];
            if (width == settled && !last) continue;
            if (k > first) draw(patch, state, rendered);
            Equations at = accumulate(rendered, map, static_cast<float>(width));
            const Vector6 offset = logarithm(from_centre * state);
            Vector6 pull = at.gradient;
            double away = 0;
            for (int i = 0; i < 6; ++i)
                for (int j = 0; j < 6; ++j) {
                    pull[i] -= prior[6 * i + j] * offset[j];
                    away += offset[i] * prior[6 * i + j] * offset[j];
                }
            at.cost += away;
            if (last && comes_down && away > reach_) {
                state = start;
                return descend(centre, state, prior, first, map, false);
            }
            if (last) return at;
            if (at.fit > kNear) settled = width;
            const Vector6 step = Cholesky(sum_of(prior, at.hessian)).solve(pull);
            state = state * exponential(step);
            if (std::max({std::abs(step[0]), std::abs(step[1]), std::abs(step[2])}) < kSmallStep[0] &&
                std::max({std::abs(step[3]), std::abs(step[4]), std::abs(step[5])}) < kSmallStep[1])
                settled = width;
        }
    }

    static void draw(Patch& patch, const Transform& state, std::vector<float>& rendered) {
        std::fill(rendered.begin(), rendered.end(), 0.0f);
        patch.draw(state, rendered.data());
    }

    // A pose in the air, drawn, sees nothing where the map is touched that could draw it there: it comes down, along its
    // own axis, to where it does, but no farther than a start is off. Whether it had to, and did.
    bool let_down(Patch& patch, Transform& state, const std::vector<float>& map, std::vector<float>& rendered) const {
        Transform lower = state;
        for (double down = 0; !meets(rendered, map); down += scene_.margin()) {
            if (down >= kWidths[0]) {
                draw(patch, state, rendered);
                return false;
            }
            lower = lower * exponential({0, 0, -scene_.margin()});
            draw(patch, lower, rendered);
        }
        const bool came_down = lower != state;
        state = lower;
        return came_down;
    }

    // Whether some surface is in sight where the map is touched.
    static bool meets(const std::vector<float>& rendered, const std::vector<float>& map) {
        for (std::size_t i = 0; i < map.size(); ++i)
            if (rendered[i] > 0 && map[i] > 0) return true;
        return false;
    }

    // The rendered map counts from the scene's margin below the gel; both maps are padded.
    Equations accumulate(const std::vector<float>& rendered, const std::vector<float>& map, float width) const {
        const int columns = scene_.width();
        const Lanes margin = all(static_cast<float>(scene_.margin())), nothing = all(-0.999f) * margin;
        const Lanes distance = all(static_cast<float>(scene_.gel_distance()));
        Lanes hessian[21] = {}, gradient[6] = {}, cost = {}, explained = {}, touched = {};
        Mask column{};
        for (int l = 0; l < kLanes; ++l) column[l] = l;
        for (int v = 1; v < scene_.height() - 1; ++v) {
            for (int u = 1; u < columns - 1; u += kLanes) {
                const int here_at = v * columns + u;
                const Lanes measured = load(map.data() + here_at), seen = load(rendered.data() + here_at) - margin;
                // beside an edge the gel lies flat: the outline of a contact says where the edge is
                const Lanes here = seen > nothing ? seen : Lanes{};
                // elsewhere nothing is expected
                const Mask touch = ((measured > 0) | (here > 0)) & (column + u < columns - 1);
                if (!any(touch)) continue;
                const Lanes residual = measured - here, ratio = residual / width;
                const Lanes weight = touch ? 1 / (1 + ratio * ratio) : Lanes{};
                const Lanes pull = weight * weight;  // Geman-McClure's influence
                cost += weight * residual * residual;
                explained += weight;
                touched += touch ? all(1) : Lanes{};

                const Lanes beside = here < 0 ? here : Lanes{};
                auto neighbour = [&](int shift) {
                    const Lanes value = load(rendered.data() + here_at + shift) - margin;
                    return value > nothing ? value : beside;
                };
                auto gel = [&](int shift) { return load(gel_depth_.data() + here_at + shift); };
                auto tx = [&](int shift) { return load(tangent_x_.data() + here_at + shift); };
                auto ty = [&](int shift) { return load(tangent_y_.data() + here_at + shift); };
                const Lanes left = neighbour(-1), right = neighbour(1);
                const Lanes above = neighbour(-columns), below = neighbour(columns);
                const Lanes dl = gel(-1) - left, dr = gel(1) - right, da = gel(-columns) - above;
                const Lanes db = gel(columns) - below, d = gel(0) - here;
                // surface tangents along the image's columns and rows, gel frame
                const Lanes ax = tx(1) * dr - tx(-1) * dl, ay = ty(1) * dr - ty(-1) * dl, az = dl - dr;
                const Lanes bx = tx(-columns) * da - tx(columns) * db, by = ty(-columns) * da - ty(columns) * db;
                const Lanes bz = db - da;
                const Lanes nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
                const Lanes towards = nx * tx(0) + ny * ty(0) - nz;
                // only where there is a surface to take a slope from, and no back side
                const Mask surface = (seen > nothing) | (left > 0) | (right > 0) | (above > 0) | (below > 0);
                const Mask usable = touch & surface & (magnitude(az) <= kSteepest * magnitude(ax)) &
                                    (magnitude(bz) <= kSteepest * magnitude(by)) & (towards < 0);
                if (!any(usable)) continue;
                const Lanes inverse = usable ? 1 / towards : Lanes{};
                const Lanes px = tx(0) * d, py = ty(0) * d, pz = distance - d;
                const Lanes jacobian[6] = {nx * inverse,
                                           ny * inverse,
                                           nz * inverse,
                                           (py * nz - pz * ny) * inverse,
                                           (pz * nx - px * nz) * inverse,
                                           (px * ny - py * nx) * inverse};
                for (int i = 0, k = 0; i < 6; ++i) {
                    const Lanes weighted = pull * jacobian[i];
                    gradient[i] += weighted * residual;
                    for (int j = 0; j <= i; ++j) hessian[k++] += weighted * jacobian[j];
                }
            }
        }
        Equations out;
        out.cost = information_ * sum(cost);
        out.fit = sum(explained) / std::max(sum(touched), 1.0);
        for (int i = 0, k = 0; i < 6; ++i) {
            out.gradient[i] = information_ * sum(gradient[i]);
            for (int j = 0; j <= i; ++j) out.hessian[6 * i + j] = out.hessian[6 * j + i] = information_ * sum(hessian[k++]);
        }
        return out;
    }

    const Scene scene_;
    const std::size_t pixels_;
    const double information_, reach_;
    std::vector<float> tangent_x_, tangent_y_, gel_depth_;
};

}  // namespace

void bind_alignment(nb::module_& m) {
    auto type = nb::class_<MapAlignment>(
        m, "MapAlignment",
        "Aligns poses on one scene to penetration maps.\n\nwidth [m]: residual of which a pixel explains half. A pose "
        "in the air comes down to what it is to touch, within `reach`, a squared Mahalanobis distance of its prior.");
    type.attr("width") = kWidths[kIterations - 1];
    type
        .def(nb::init<const Scene&, In<double, -1, -1>, In<double, -1, -1>, In<double, -1, -1>, double,
                      double>(),
             nb::arg("scene"), named("tangent_x"), named("tangent_y"), named("gel_depth"), nb::arg("information"),
             nb::arg("reach"))
        .def("align", &MapAlignment::align, named("pose"), named("covariance"), named("map"), named("start"),
             "Posterior pose (4, 4), covariance (6, 6), log-evidence and fit of the prior N(pose, covariance), own "
             "frame, given a map (H, W) [m]; the optimum is looked for from `start` (4, 4).");
}
