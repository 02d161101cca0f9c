// Clustering of regions of SE(3) by their mass, and the moments of each cluster.
#include "arrays.hpp"
#include "pose_distance.hpp"
#include "quaternion.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

constexpr double kValley = 0.5;  // two peaks stay two modes if the density between them falls below this share
typedef double Quad __attribute__((vector_size(4 * sizeof(double)), aligned(sizeof(double)), may_alias));
constexpr std::size_t kCoordinates = 8, kSums = kCoordinates * kCoordinates + 1;

// Mass of each occupied region plus half that of its neighbours: a density with less sampling noise.
Out<double> smooth_regions(In<int64_t, -1> occupied, In<double, -1> mass, In<int64_t, -1> start,
                           In<int32_t, -1> neighbours) {
    auto density = make_array<double>({mass.shape(0)});
    for (std::size_t i = 0; i < occupied.shape(0); ++i) {
        const int64_t r = occupied.data()[i];
        double around = 0;
        for (int64_t j = start.data()[r]; j < start.data()[r + 1]; ++j) around += mass.data()[neighbours.data()[j]];
        density.data()[r] = mass.data()[r] + 0.5 * around;
    }
    return density;
}

// Root (K,) of each region in `order` (by falling density); the number of regions, K, for all others.
Out<int64_t> climb_regions(In<int64_t, -1> order, In<double, -1> density, In<int64_t, -1> start,
                           In<int32_t, -1> neighbours, In<float, -1, kRecord> centres, float squared_radius) {
    const int64_t count = static_cast<int64_t>(density.shape(0));
    auto result = make_array<int64_t>({density.shape(0)});
    int64_t* root = result.data();
    std::fill_n(root, count, count);
    auto find = [&](int64_t r) {
        while (root[r] != r) r = root[r] = root[root[r]];
        return r;
    };
    const double* rho = density.data();
    for (std::size_t i = 0; i < order.shape(0); ++i) {
        const int64_t r = order.data()[i], first = start.data()[r], last = start.data()[r + 1];
        int64_t best = -1;
        for (int64_t j = first; j < last; ++j) {
            const int64_t other = neighbours.data()[j];
            if (root[other] < count && (best < 0 || rho[other] > rho[best])) best = other;
        }
        if (best < 0) {
            root[r] = r;
            continue;
        }
        int64_t own = root[r] = find(best);
        for (int64_t j = first; j < last; ++j) {
            if (root[neighbours.data()[j]] == count) continue;
            const int64_t rival = find(neighbours.data()[j]);
            if (rival == own) continue;
            const bool below = rho[rival] < rho[own];
            const int64_t lower = below ? rival : own, higher = below ? own : rival;
            const float* a = centres.data() + kRecord * lower;
            if (squared_pose_distance(a, a + 4, centres.data() + kRecord * higher) <= squared_radius &&
                rho[r] >= kValley * rho[lower]) {
                root[lower] = higher;
                if (own == lower) own = higher;
            }
        }
    }
    for (std::size_t i = 0; i < order.shape(0); ++i) root[order.data()[i]] = find(order.data()[i]);
    return result;
}

// Mass (count,) of each region.
Out<double> region_mass(In<int32_t, -1> of_entry, In<int32_t, -1> entries, In<double, -1> weights, std::size_t count) {
    if (entries.shape(0) != weights.shape(0)) throw nb::value_error("entries and weights of different sizes");
    auto mass = make_array<double>({count});
    for (std::size_t i = 0; i < entries.shape(0); ++i)
        mass.data()[of_entry.data()[entries.data()[i]]] += weights.data()[i];
    return mass;
}

// Sums per mode over particles [low, high): of w x x' (8, 8) for x = (1, position, quaternion), relative to the mode's
// reference and on its quaternion's side; and their number.
void sum_modes(std::size_t low, std::size_t high, In<float, -1, 3> positions, In<float, -1, 4> quaternions,
               In<int32_t, -1> entries, In<double, -1> weights, In<int32_t, -1> of_entry,
               In<int32_t, -1> mode_of_region, In<double, -1, kRecord> reference, InOut<double, -1, kSums> out) {
    if (low > high || high > positions.shape(0) || high > quaternions.shape(0) || high > entries.shape(0) ||
        high > weights.shape(0))
        throw nb::value_error("range beyond the particles");
    if (out.shape(0) != reference.shape(0)) throw nb::value_error("sums and references of different sizes");
    nb::gil_scoped_release released;
    for (std::size_t i = low; i < high; ++i) {
        const int32_t mode = mode_of_region.data()[of_entry.data()[entries.data()[i]]];
        if (mode < 0) continue;
        const double w = weights.data()[i], *origin = reference.data() + kRecord * mode;
        const float *t = positions.data() + 3 * i, *q = quaternions.data() + 4 * i;
        double dot = 0;
        for (int a = 0; a < 4; ++a) dot += q[a] * origin[4 + a];
        const double side = dot < 0 ? -1 : 1;
        const double x[kCoordinates] = {1,           t[0] - origin[0], t[1] - origin[1], t[2] - origin[2],
                                        side * q[0], side * q[1],      side * q[2],      side * q[3]};
        const Quad first{x[0], x[1], x[2], x[3]}, last{x[4], x[5], x[6], x[7]};
        double* sum = out.data() + kSums * mode;
        for (std::size_t a = 0; a < kCoordinates; ++a) {
            Quad* row = reinterpret_cast<Quad*>(sum + kCoordinates * a);
            row[0] += w * x[a] * first;
            row[1] += w * x[a] * last;
        }
        sum[kSums - 1] += 1;
    }
}

// Eigenvector of the largest eigenvalue of a matrix (4, 4), positive semidefinite, by repeated squaring. If several
// eigenvalues are the largest to 0.1 %, a vector of their common space; (0, 0, 0, 1) of a zero matrix.
Quaternion<double> principal_axis(const double* square) {
    double power[4][4], squared[4][4];
    const double trace = square[0] + square[5] + square[10] + square[15];
    if (!(trace > 0)) return {0, 0, 0, 1};
    for (int i = 0; i < 16; ++i) power[i / 4][i % 4] = square[i] / trace;
    for (int round = 0; round < 14; ++round) {
        double sum = 0;
        for (int i = 0; i < 4; ++i) {
            for (int j = 0; j < 4; ++j) {
                squared[i][j] = 0;
                for (int k = 0; k < 4; ++k) squared[i][j] += power[i][k] * power[k][j];
            }
            sum += squared[i][i];
        }
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j) power[i][j] = squared[i][j] / sum;
    }
    int largest = 0;
    for (int i = 1; i < 4; ++i)
        if (power[i][i] > power[largest][largest]) largest = i;
    double length = 0;
    for (int i = 0; i < 4; ++i) length += power[i][largest] * power[i][largest];
    length = std::sqrt(length);
    return {power[0][largest] / length, power[1][largest] / length, power[2][largest] / length,
            power[3][largest] / length};
}

// Poses (m, 4, 4) and covariances (m, 6, 6) of modes from their moments. The mean rotation is Markley's (2007); a
// deviation is the vector 2 vec(q mean^-1), which is linear in q.
nb::tuple gaussians(In<double, -1, 7> reference, In<double, -1, 3> position, In<double, -1, 3, 3> position_square,
                    In<double, -1, 4> quaternion, In<double, -1, 4, 4> quaternion_square, In<double, -1, 3, 4> cross) {
    const std::size_t n = reference.shape(0);
    if (position.shape(0) != n || position_square.shape(0) != n || quaternion.shape(0) != n ||
        quaternion_square.shape(0) != n || cross.shape(0) != n)
        throw nb::value_error("moments of different numbers of modes");
    auto poses = make_array<double>({n, 4, 4}), covariance = make_array<double>({n, 6, 6});
    for (std::size_t k = 0; k < n; ++k) {
        const double *origin = reference.data() + 7 * k, *t = position.data() + 3 * k, *q = quaternion.data() + 4 * k;
        const double *tt = position_square.data() + 9 * k, *qq = quaternion_square.data() + 16 * k;
        const double *tq = cross.data() + 12 * k, *u = origin + 3;
        Quaternion<double> mean = principal_axis(qq);
        if (mean.x * u[0] + mean.y * u[1] + mean.z * u[2] + mean.w * u[3] < 0)
            mean = {-mean.x, -mean.y, -mean.z, -mean.w};
        double* pose = poses.data() + 16 * k;
        to_matrix(mean, pose, 4);
        for (int a = 0; a < 3; ++a) pose[4 * a + 3] = origin[a] + t[a];
        pose[15] = 1;
        const double x = 2 * mean.x, y = 2 * mean.y, z = 2 * mean.z, w = 2 * mean.w;
        const double linear[3][4] = {{w, -z, y, -x}, {z, w, -x, -y}, {-y, x, w, -z}};
        double* c = covariance.data() + 36 * k;
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b) {
                c[6 * a + b] = tt[3 * a + b] - t[a] * t[b];
                double turns = 0, both = 0;
                for (int i = 0; i < 4; ++i) {
                    for (int j = 0; j < 4; ++j) turns += linear[a][i] * qq[4 * i + j] * linear[b][j];
                    both += (tq[4 * a + i] - t[a] * q[i]) * linear[b][i];
                }
                c[6 * (3 + a) + 3 + b] = turns;
                c[6 * a + 3 + b] = c[6 * (3 + b) + a] = both;
            }
        // rounding can leave a variance a few 1e-19 below zero
        for (int a = 0; a < 6; ++a) c[7 * a] = std::max(c[7 * a], 0.0);
    }
    return nb::make_tuple(poses, covariance);
}

}  // namespace

void bind_modes(nb::module_& m) {
    m.def("smooth_regions", &smooth_regions, named("occupied"), named("mass"), named("start"), named("neighbours"),
          "Density (K,) of each occupied region: its mass and half that of its neighbours.");
    m.def("climb_regions", &climb_regions, named("order"), named("density"), named("start"), named("neighbours"),
          named("centres"), nb::arg("squared_radius"),
          "Region (K,) at the peak that each region of `order`, by falling density, belongs to; K for all others.");
    m.def("region_mass", &region_mass, named("of_entry"), named("entries"), named("weights"), nb::arg("count"),
          "Mass (count,) of each region: the sum of the weights of the particles whose entries belong to it.");
    m.def("sum_modes", &sum_modes, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"),
          named("entries"), named("weights"), named("of_entry"), named("mode_of_region"), named("reference"),
          named("out"), "Add to (m, 65), for each mode over the particles [low, high): w x x' (8, 8) of x = (1, position, "
          "quaternion), relative to the reference; and their number.");
    m.def("gaussians", &gaussians, named("reference"), named("position"), named("position_square"),
          named("quaternion"), named("quaternion_square"), named("cross"),
          "Poses (m, 4, 4) and covariances (m, 6, 6), fixed axes, of modes from their moments.");
}
