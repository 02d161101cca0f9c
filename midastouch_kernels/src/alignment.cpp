// Alignment of a sensor pose to the penetration map that it feels: Gauss-Newton on the pose's own rendered view.
#include "arrays.hpp"
#include "cholesky.hpp"
#include "gaussian.hpp"
#include "lanes.hpp"
#include "parallel.hpp"
#include "patch.hpp"
#include "tangent.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace {

// m, residual at which a pixel's weight has halved (Geman and McClure 1987), iteration by iteration: wide first, so
// that a start a millimetre off is not all outliers (graduated non-convexity, Blake and Zisserman 1987)
constexpr double kWidths[] = {2e-3, 2e-3, 1e-3, 1e-3, 5e-4, 5e-4, 3e-4, 3e-4};
constexpr int kIterations = std::size(kWidths);
constexpr double kNarrowest = kWidths[kIterations - 1];
constexpr double kSmallStep[] = {5e-5, 2e-3};  // m, rad: no second iteration at the same width after one this small
constexpr double kNear = 0.9;            // fit at a width, beyond which a second iteration at the same tells no more
constexpr float kSteepest = 3.0f;        // slope beyond which a finite difference across a silhouette says nothing
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
        if (!(scene.margin() > 0))
            throw nb::value_error("a scene without a margin: what is about to touch is not seen");
        tangent_x_ = padded(tangent_x.data(), pixels_), tangent_y_ = padded(tangent_y.data(), pixels_);
        gel_depth_ = padded(gel_depth.data(), pixels_);
    }

    // See `align` of the binding.
    nb::tuple align(In<double, 4, 4> pose, In<double, 6, 6> covariance, In<float, -1, -1> map,
                    In<double, 4, 4> start) const {
        check_size(map.shape(0), map.shape(1));
        auto found_pose = make_array<double>({4, 4}), found_covariance = make_array<double>({6, 6});
        Descent found;
        {
            nb::gil_scoped_release released;
            Workspace work(scene_);
            found = descent(work, {item_at<Transform>(pose.data(), 0), item_at<Matrix6>(covariance.data(), 0)},
                            item_at<Transform>(start.data(), 0), padded(map.data(), pixels_), 0);
            put(found.posterior.mean, found_pose.data(), 0);
            put(found.posterior.covariance, found_covariance.data(), 0);
        }
        return nb::make_tuple(found_pose, found_covariance, found.fit);
    }

    // See `align_each` of the binding.
    nb::tuple align_each(In<double, -1, 4, 4> poses, In<double, -1, 6, 6> covariances, In<float, -1, -1, -1> maps,
                         In<double, -1, 4, 4> gels, In<double, 6, 6> jitter, In<double, 6, 6> finger_error,
                         In<double, -1> needed, int descents, bool seeds, double explains, double patches,
                         double floor) const {
        const std::size_t n = poses.shape(0), fingers = maps.shape(0);
        check_size(maps.shape(1), maps.shape(2));
        if (covariances.shape(0) != n || needed.shape(0) != n) throw nb::value_error("not as many of each as poses");
        if (!fingers || gels.shape(0) != fingers) throw nb::value_error("no map, or not as many gels as maps");
        auto means = make_array<double>({n, 4, 4}), spreads = make_array<double>({n, 6, 6});
        auto seen_means = make_array<double>({n, 4, 4}), seen_spreads = make_array<double>({n, 6, 6});
        auto fits = make_array<double>({n, fingers});
        auto counts = make_array<int32_t>({n});
        {
            nb::gil_scoped_release released;
            std::vector<Touch> touches;
            for (std::size_t f = 0; f < fingers; ++f)
                touches.push_back({padded(maps.data() + f * pixels_, pixels_), item_at<Transform>(gels.data(), f)});
            const auto touched = std::count_if(maps.data(), maps.data() + maps.size(), [](float x) { return x > 0; });
            // nats that maps speak against a pose which explains nothing of them, if their noise is as given
            const double nats = 0.5 * information_ * kNarrowest * kNarrowest * std::max<double>(touched, 1);
            const Matrix6 own = item_at<Matrix6>(jitter.data(), 0), others = item_at<Matrix6>(finger_error.data(), 0);
            parallel_for(n, kPiece, [&](std::size_t first, std::size_t last) {
                Workspace work(scene_);
                for (std::size_t i = first; i < last; ++i) {
                    Gaussian hypothesis{item_at<Transform>(poses.data(), i), item_at<Matrix6>(covariances.data(), i)};
                    Gaussian prior{hypothesis.mean, sum_of(hypothesis.covariance, own)};
                    const Settled at = settle(work, prior, touches, others, needed.data()[i], descents, seeds);
                    hypothesis.mean = prior.mean;
                    if (at.fit() > explains) {
                        // the noise of a map is as large as what it leaves unexplained says
                        const double factor = patches / (1 - at.fit() + floor) / nats;
                        hypothesis =
                            condition(hypothesis, own, factor < 1 ? weaken(prior, at.posterior, factor) : at.posterior);
                    }
                    put(hypothesis.mean, means.data(), i), put(hypothesis.covariance, spreads.data(), i);
                    put(at.posterior.mean, seen_means.data(), i);
                    put(at.posterior.covariance, seen_spreads.data(), i);
                    std::copy(at.fits.begin(), at.fits.end(), fits.data() + i * fingers);
                    counts.data()[i] = at.descents;
                }
            });
        }
        return nb::make_tuple(means, spreads, fits, seen_means, seen_spreads, counts);
    }

private:
    static constexpr std::size_t kPiece = 8;  // hypotheses that share a workspace
    static constexpr double kMore = 0.12,
                            kExplained = 0.95;  // of what is unexplained: less is no gain; of a map: no more is needed
    // The iteration after which hardly more than a further `kStillGained` of a map gets explained.
    static constexpr int kDecided = 4;
    static constexpr double kStillGained = 0.15;
    static constexpr Transform kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

    // What descents need, allocated once for many.
    struct Workspace {
        explicit Workspace(const Scene& scene)
            : patch(scene), rendered(static_cast<std::size_t>(scene.height()) * scene.width() + 2 * kLanes) {}
        Patch patch;
        std::vector<float> rendered;
    };

    // A finger's map, padded, and its gel in the first one's frame.
    struct Touch {
        std::vector<float> map;
        Transform gel;
    };

    struct Descent {
        Gaussian posterior;
        double fit;
    };

    // A posterior of all fingers' maps, the fraction explained of each, and after how many descents.
    struct Settled {
        double fit() const { return *std::min_element(fits.begin(), fits.end()); }

        Gaussian posterior;
        std::vector<double> fits;
        int descents;
    };

    void check_size(std::size_t rows, std::size_t columns) const {
        if (static_cast<int>(rows) != scene_.height() || static_cast<int>(columns) != scene_.width())
            throw nb::value_error("a penetration map of another size than the sensor's");
    }

    Descent descent(Workspace& work, const Gaussian& prior, const Transform& start, const std::vector<float>& map,
                    double needed) const {
        Transform state = start;
        const Matrix6 inverse = Cholesky(prior.covariance).inverse();
        const Equations at =
            descend(work, prior.mean, state, inverse, first_width(prior.covariance), map, true, needed);
        return {{state, Cholesky(sum_of(inverse, at.hessian)).inverse()}, at.fit};
    }

    // The posterior of all fingers' maps in turn, from where it ended as long as that explains more of them: one
    // descent stops short where a start is some millimetres and a sharp edge away. A prior that only seeds the search
    // goes along with it.
    Settled settle(Workspace& work, Gaussian& prior, const std::vector<Touch>& touches, const Matrix6& others,
                   double needed, int most, bool seeds) const {
        Settled best = in_turn(work, prior, prior.mean, touches, others, needed);
        int descents = 1;
        bool more = true;
        for (; more && descents < most && best.fit() < kExplained && best.fit() >= needed - kStillGained; ++descents) {
            const Gaussian next = seeds ? Gaussian{best.posterior.mean, prior.covariance} : prior;
            Settled again = in_turn(work, next, best.posterior.mean, touches, others, needed);
            more = again.fit() - best.fit() >= kMore * (1 - best.fit());
            if (again.fit() > best.fit()) best = std::move(again), prior = next;
        }
        best.descents = descents;
        return best;
    }

    Settled in_turn(Workspace& work, Gaussian belief, Transform start, const std::vector<Touch>& touches,
                    const Matrix6& others, double needed) const {
        std::vector<double> fits;
        for (const Touch& touch : touches) {
            const bool first = touch.gel == kIdentity;
            const Gaussian there = first ? belief : moved(belief, touch.gel);
            const Gaussian prior = first ? there : Gaussian{there.mean, sum_of(there.covariance, others)};
            const Descent found = descent(work, prior, first ? start : start * touch.gel, touch.map, needed);
            belief = first ? found.posterior : moved(condition(there, others, found.posterior), inverse(touch.gel));
            start = belief.mean;  // a further finger begins where those before it have led
            fits.push_back(found.fit);
        }
        return {belief, fits, 1};
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
    // It ends early, with the equations there, once less than `needed` of the map can be explained.
    Equations descend(Workspace& work, const Transform& centre, Transform& state, const Matrix6& prior, int first,
                      const std::vector<float>& map, bool comes_down, double needed) const {
        const Transform start = state;
        const Transform from_centre = inverse(centre);
        std::vector<float>& rendered = work.rendered;
        Patch& patch = work.patch;
        patch.restart();
        double settled = INFINITY;
        draw(patch, state, rendered);
        comes_down = comes_down && let_down(patch, state, map, rendered);
        for (int k = first;; ++k) {
            const double width = kWidths[std::min(k, kIterations - 1)];
            if (width == settled && k < kIterations) continue;
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
            bool over = k == kIterations;
            if (k == std::max(kDecided, first + 1) && needed > kStillGained) {
                Equations sharp = accumulate(rendered, map, static_cast<float>(kNarrowest));
                if (sharp.fit < needed - kStillGained) over = true, at = sharp;
            }
            at.cost += away;
            if (over && comes_down && away > reach_) {
                state = start;
                return descend(work, centre, state, prior, first, map, false, needed);
            }
            if (over) return at;
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

    // A pose in the air, drawn, sees nothing where the map is touched that could draw it there: it comes down, along
    // its own axis, to where it does, but no farther than a start is off. Whether it had to, and did.
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
            for (int j = 0; j <= i; ++j)
                out.hessian[6 * i + j] = out.hessian[6 * j + i] = information_ * sum(hessian[k++]);
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
    nb::class_<MapAlignment>(
        m, "MapAlignment",
        "Aligns poses on one scene to penetration maps.\n\nA pose in the air comes down to what it is to touch, within "
        "`reach`, a squared Mahalanobis distance of its prior.")
        .def(nb::init<const Scene&, In<double, -1, -1>, In<double, -1, -1>, In<double, -1, -1>, double, double>(),
             nb::arg("scene"), named("tangent_x"), named("tangent_y"), named("gel_depth"), nb::arg("information"),
             nb::arg("reach"))
        .def("align", &MapAlignment::align, named("pose"), named("covariance"), named("map"), named("start"),
             "Posterior pose (4, 4), covariance (6, 6) and fit of the prior N(pose, covariance), own "
             "frame, given a map (H, W) [m]; the optimum is looked for from `start` (4, 4).")
        .def(
            "align_each", &MapAlignment::align_each, named("poses"), named("covariances"), named("maps"), named("gels"),
            named("jitter"), named("finger_error"), named("needed"), nb::arg("descents"), nb::arg("seeds"),
            nb::arg("explains"), nb::arg("patches"), nb::arg("floor"),
            "Align N Gaussians of the first finger's gel, poses (N, 4, 4) and covariances (N, 6, 6) in their own "
            "frames, to the maps (F, H, W) [m] of F fingers, one after the other. gels (F, 4, 4): each finger's gel in "
            "the first one's frame, the identity its own. jitter, finger_error (6, 6): covariances of this frame's "
            "error of the first gel's measured pose, and of a further one's given that. descents: how often at most, "
            "each from where the last one ended; seeds: the Gaussians only say where to begin, and each descent's is "
            "centred there, too. needed (N,): fraction of each map below which a Gaussian does not "
            "matter, and is left early. Returns poses and covariances without this frame's error, unchanged unless "
            "more than `explains` of every map is explained; fits (N, F); poses and covariances in this frame; "
            "descents (N,). patches, floor: the evidence of a map is -patches log(1 - fit + floor).");
}
