// Motion of the gel over what it touches, from one penetration map to the next: point-to-plane registration with
// projective correspondences (Chen and Medioni 1992; Blais and Levine 1995), without any model of the object.
#include "arrays.hpp"
#include "cholesky.hpp"
#include "tangent.hpp"

#include <cmath>
#include <vector>

namespace {

// m, residual at which a pixel's weight has halved (Geman and McClure 1987), iteration by iteration: wide first
constexpr double kWidths[] = {2e-3, 1e-3, 1e-3, 5e-4, 5e-4, 3e-4, 3e-4};
constexpr double kSmallStep = 1e-5;      // m, 1 rad counting as 10 mm: no further iteration at this width
constexpr double kRotationScale = 0.01;  // m that one radian counts as
constexpr int kReach = 2;                // px on either side that a slope is taken over: it evens out a map's noise

struct Point {
    double position[3], normal[3];  // gel frame of the earlier map
};

class MapOdometry {
public:
    // Depth of the undeformed gel (H, W) [m], the camera's focal length [px] and distance [m]; information of one
    // pixel [1 / m^2].
    MapOdometry(In<double, -1, -1> gel_depth, double focal, double gel_distance, double information)
        : rows_(static_cast<int>(gel_depth.shape(0))), columns_(static_cast<int>(gel_depth.shape(1))),
          gel_depth_(gel_depth.data(), gel_depth.data() + gel_depth.size()), focal_(focal), distance_(gel_distance),
          information_(information) {}

    nb::tuple align(In<float, -1, -1> earlier, In<float, -1, -1> later, In<double, 4, 4> motion,
                    In<double, 6, 6> covariance, In<double, 4, 4> start) const {
        for (const auto& map : {earlier, later})
            if (static_cast<int>(map.shape(0)) != rows_ || static_cast<int>(map.shape(1)) != columns_)
                throw nb::value_error("a penetration map of another size than the sensor's");
        auto found = make_array<double>({4, 4}), information = make_array<double>({6, 6});
        double fit;
        {
            nb::gil_scoped_release released;
            Transform centre;
            Matrix6 spread;
            std::copy_n(motion.data(), 16, centre.begin());
            std::copy_n(covariance.data(), 36, spread.begin());
            Transform state;
            std::copy_n(start.data(), 16, state.begin());
            const Equations at = descend(centre, state, Cholesky(spread).inverse(), surface(earlier.data()),
                                         later.data());
            fit = at.fit;
            std::copy_n(state.begin(), 16, found.data());
            std::copy_n(at.hessian.begin(), 36, information.data());
        }
        return nb::make_tuple(found, information, fit);
    }

private:
    // Robust normal equations in the motion's tangent space, and the fraction of common pixels explained.
    struct Equations {
        Matrix6 hessian{};
        Vector6 gradient{};
        double fit = 0;
    };

    void unproject(const float* map, int v, int u, double* out) const {
        const int at = v * columns_ + u;
        const double depth = gel_depth_[at] - map[at];
        out[0] = (u + 0.5 - 0.5 * columns_) / focal_ * depth;
        out[1] = (0.5 * rows_ - v - 0.5) / focal_ * depth;
        out[2] = distance_ - depth;
    }

    // What the earlier map touches, wherever a slope can be taken.
    std::vector<Point> surface(const float* map) const {
        std::vector<Point> points;
        for (int v = kReach; v < rows_ - kReach; ++v)
            for (int u = kReach; u < columns_ - kReach; ++u) {
                const float* here = map + v * columns_ + u;
                const bool inside = here[0] > 0 && here[-kReach] > 0 && here[kReach] > 0 &&
                                    here[-kReach * columns_] > 0 && here[kReach * columns_] > 0;
                if (!inside) continue;
                Point point;
                double left[3], right[3], above[3], below[3];
                unproject(map, v, u, point.position);
                unproject(map, v, u - kReach, left), unproject(map, v, u + kReach, right);
                unproject(map, v - kReach, u, above), unproject(map, v + kReach, u, below);
                double a[3], b[3];
                for (int k = 0; k < 3; ++k) a[k] = right[k] - left[k], b[k] = above[k] - below[k];
                double* n = point.normal;
                n[0] = a[1] * b[2] - a[2] * b[1], n[1] = a[2] * b[0] - a[0] * b[2], n[2] = a[0] * b[1] - a[1] * b[0];
                points.push_back(point);
            }
        return points;
    }

    Equations descend(const Transform& centre, Transform& state, const Matrix6& prior, const std::vector<Point>& points,
                      const float* later) const {
        const Transform from_centre = inverse(centre);
        double settled = INFINITY;
        for (const double width : kWidths) {
            if (width == settled) continue;
            const Equations at = accumulate(state, points, later, width);
            const Vector6 offset = logarithm(from_centre * state);
            Vector6 pull = at.gradient;
            Matrix6 sum = prior;
            for (int i = 0; i < 6; ++i)
                for (int j = 0; j < 6; ++j) {
                    pull[i] -= prior[6 * i + j] * offset[j];
                    sum[6 * i + j] += at.hessian[6 * i + j];
                }
            const Vector6 step = Cholesky(sum).solve(pull);
            state = state * exponential(step);
            double squared = 0;
            for (int k = 0; k < 3; ++k)
                squared += step[k] * step[k] + kRotationScale * kRotationScale * step[k + 3] * step[k + 3];
            if (squared < kSmallStep * kSmallStep) settled = width;
        }
        return accumulate(state, points, later, kWidths[std::size(kWidths) - 1]);
    }

    Equations accumulate(const Transform& state, const std::vector<Point>& points, const float* later,
                         double width) const {
        const Transform back = inverse(state);
        Equations out;
        double explained = 0, shared = 0;
        for (const Point& point : points) {
            double p[3], n[3];
            for (int i = 0; i < 3; ++i) {
                p[i] = back[4 * i + 3], n[i] = 0;
                for (int j = 0; j < 3; ++j) {
                    p[i] += back[4 * i + j] * point.position[j];
                    n[i] += back[4 * i + j] * point.normal[j];
                }
            }
            const double depth = distance_ - p[2], tx = p[0] / depth, ty = p[1] / depth;
            const double u = tx * focal_ + 0.5 * columns_ - 0.5, v = 0.5 * rows_ - 0.5 - ty * focal_;
            const double column = std::floor(u), row = std::floor(v);
            if (!(column >= 0 && row >= 0 && column < columns_ - 1 && row < rows_ - 1)) continue;
            const std::size_t at = static_cast<std::size_t>(row) * columns_ + static_cast<std::size_t>(column);
            const double a = u - column, b = v - row;
            auto between = [&](const auto* map) {
                return (1 - b) * ((1 - a) * map[0] + a * map[1]) +
                       b * ((1 - a) * map[columns_] + a * map[columns_ + 1]);
            };
            const double measured = between(later + at), expected = between(gel_depth_.data() + at) - depth;
            const double towards = n[0] * tx + n[1] * ty - n[2];
            // neither measured nor expected: it left the gel, and where it is now nobody sees
            if ((measured <= 0 && expected <= 0) || !(towards < 0)) continue;
            const double residual = measured - expected, ratio = residual / width;
            const double weight = 1 / (1 + ratio * ratio), pull = weight * weight * information_;
            explained += weight, shared += 1;
            const double jacobian[6] = {n[0] / towards,
                                        n[1] / towards,
                                        n[2] / towards,
                                        (p[1] * n[2] - p[2] * n[1]) / towards,
                                        (p[2] * n[0] - p[0] * n[2]) / towards,
                                        (p[0] * n[1] - p[1] * n[0]) / towards};
            for (int i = 0; i < 6; ++i) {
                out.gradient[i] += pull * jacobian[i] * residual;
                for (int j = 0; j <= i; ++j) out.hessian[6 * i + j] += pull * jacobian[i] * jacobian[j];
            }
        }
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j < i; ++j) out.hessian[6 * j + i] = out.hessian[6 * i + j];
        out.fit = explained / std::max(shared, 1.0);
        return out;
    }

    int rows_, columns_;
    std::vector<double> gel_depth_;
    double focal_, distance_, information_;
};

}  // namespace

void bind_map_odometry(nb::module_& m) {
    nb::class_<MapOdometry>(m, "MapOdometry", "Motion of the gel from one penetration map to the next.")
        .def(nb::init<In<double, -1, -1>, double, double, double>(), named("gel_depth"), nb::arg("focal"),
             nb::arg("gel_distance"), nb::arg("information"))
        .def("align", &MapOdometry::align, named("earlier"), named("later"), named("motion"), named("covariance"),
             named("start"),
             "Motion (4, 4), later gel in the earlier gel's frame, its information (6, 6), own frame, from the maps "
             "(H, W) [m] alone, and fit; the prior is N(motion, covariance), own frame; the optimum is looked for from `start` (4, 4).");
}
