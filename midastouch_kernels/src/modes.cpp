// Clustering of regions of SE(3) by their mass, and the moments of each cluster.
#include "arrays.hpp"
#include "pose_distance.hpp"
#include "quaternion.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <vector>

namespace {

constexpr double kValley = 0.5;  // two peaks stay two modes if the density between them falls below this fraction
constexpr std::size_t kCoordinates = 8, kSums = kCoordinates * kCoordinates + 1;

// The regions as a graph: neighbours of region r are neighbour[start[r]] up to neighbour[start[r + 1]], ascending.
struct RegionGraph {
    const int64_t* start;
    const int32_t* neighbour;
    const float* centre;  // pose records
    float squared_radius;

    // Mass of each occupied region plus half that of its neighbours: a density with less sampling noise.
    std::vector<double> smooth(const std::vector<int64_t>& occupied, const double* mass, std::size_t count) const {
        std::vector<double> density(count);
        for (const int64_t r : occupied) {
            double around = 0;
            for (int64_t j = start[r]; j < start[r + 1]; ++j) around += mass[neighbour[j]];
            density[r] = mass[r] + 0.5 * around;
        }
        return density;
    }

    bool near(int64_t a, int64_t b) const {
        const float* there = centre + kRecord * a;
        return squared_pose_distance(there, there + 4, centre + kRecord * b) <= squared_radius;
    }

    // Region at the peak that each region of `order` (by falling density) belongs to; -1 for all others.
    std::vector<int64_t> climb(const std::vector<int64_t>& order, const std::vector<double>& rho) const {
        const int32_t size = static_cast<int32_t>(order.size());
        std::vector<int32_t> place(rho.size(), size), root(order.size()), denser;
        for (int32_t i = 0; i < size; ++i) place[order[i]] = i;
        auto find = [&](int32_t i) {
            while (root[i] != i) i = root[i] = root[root[i]];
            return i;
        };
        for (int32_t i = 0; i < size; ++i) {
            const int64_t r = order[i];
            denser.resize(start[r + 1] - start[r]);
            std::size_t count = 0;
            int32_t best = i;
            for (int64_t j = start[r]; j < start[r + 1]; ++j) {  // without a branch, that nobody could predict
                const int32_t other = place[neighbour[j]];
                denser[count] = other, count += other < i, best = std::min(best, other);
            }
            int32_t own = root[i] = best < i ? find(best) : i;
            for (std::size_t j = 0; j < count; ++j) {
                const int32_t other_peak = find(denser[j]);
                if (other_peak == own) continue;
                const bool below = rho[order[other_peak]] < rho[order[own]];
                const int32_t lower = below ? other_peak : own, higher = below ? own : other_peak;
                if (near(order[lower], order[higher]) && rho[r] >= kValley * rho[order[lower]]) {
                    root[lower] = higher;
                    if (own == lower) own = higher;
                }
            }
        }
        std::vector<int64_t> peak(rho.size(), -1);
        for (int32_t i = 0; i < size; ++i) peak[order[i]] = order[find(i)];
        return peak;
    }
};

// By falling value, equal ones in their order.
void sort_by(std::vector<int64_t>& regions, const std::vector<double>& value) {
    std::stable_sort(regions.begin(), regions.end(), [&](int64_t a, int64_t b) { return value[a] > value[b]; });
}

// Peaks (m,) of the modes, heaviest first, and the mode (K,) of each region, -1 for none. Only the `most_regions`
// heaviest regions count; modes lighter than `least_mass` and beyond `most_modes` are left out, but not the heaviest.
nb::tuple cluster_regions(In<double, -1> mass, In<int64_t, -1> start, In<int32_t, -1> neighbours,
                          In<float, -1, kRecord> centres, float squared_radius, double least_mass,
                          std::size_t most_regions, std::size_t most_modes) {
    const std::size_t count = mass.shape(0);
    if (start.shape(0) != count + 1 || centres.shape(0) != count)
        throw nb::value_error("masses, neighbours and centres of different numbers of regions");
    const double* m = mass.data();
    const RegionGraph graph{start.data(), neighbours.data(), centres.data(), squared_radius};
    std::vector<int64_t> occupied;
    for (std::size_t r = 0; r < count; ++r)
        if (m[r] > 0) occupied.push_back(static_cast<int64_t>(r));
    if (occupied.size() > most_regions) {
        std::nth_element(occupied.begin(), occupied.begin() + static_cast<std::ptrdiff_t>(most_regions), occupied.end(),
                         [&](int64_t a, int64_t b) { return m[a] != m[b] ? m[a] > m[b] : a < b; });
        occupied.resize(most_regions);
        std::sort(occupied.begin(), occupied.end());
    }
    const std::vector<double> density = graph.smooth(occupied, m, count);
    std::vector<int64_t> order = occupied;
    sort_by(order, density);
    const std::vector<int64_t> root = graph.climb(order, density);
    std::vector<double> mass_of_root(count);
    for (const int64_t r : occupied) mass_of_root[root[r]] += m[r];
    std::vector<int64_t> peaks;
    for (const int64_t r : occupied)
        if (root[r] == r) peaks.push_back(r);
    sort_by(peaks, mass_of_root);
    if (peaks.size() > most_modes) peaks.resize(most_modes);
    while (peaks.size() > 1 && mass_of_root[peaks.back()] < least_mass) peaks.pop_back();
    auto mode_of_region = make_array<int32_t>({count});
    std::fill_n(mode_of_region.data(), count, -1);
    for (std::size_t k = 0; k < peaks.size(); ++k) mode_of_region.data()[peaks[k]] = static_cast<int32_t>(k);
    for (const int64_t r : occupied) mode_of_region.data()[r] = mode_of_region.data()[root[r]];
    return nb::make_tuple(copy_of(peaks), mode_of_region);
}

// Mass (count,) of each region.
Out<double> region_mass(In<int32_t, -1> of_entry, In<int32_t, -1> entries, In<double, -1> weights, std::size_t count) {
    if (entries.shape(0) != weights.shape(0)) throw nb::value_error("entries and weights of different sizes");
    auto mass = make_array<double>({count});
    for (std::size_t i = 0; i < entries.shape(0); ++i)
        mass.data()[of_entry.data()[entries.data()[i]]] += weights.data()[i];
    return mass;
}

// How many of `count` regions the entries belong to.
std::size_t occupied_regions(In<int32_t, -1> of_entry, In<int32_t, -1> entries, std::size_t count) {
    std::vector<uint8_t> taken(count);
    std::size_t found = 0;
    for (std::size_t i = 0; i < entries.shape(0); ++i) {
        uint8_t& here = taken[of_entry.data()[entries.data()[i]]];
        found += !here, here = 1;
    }
    return found;
}

// The rank (N,) of the mode of each particle; the last one stands for mode -1.
Out<int32_t> members(In<int32_t, -1> entries, In<int32_t, -1> of_entry, In<int32_t, -1> mode_of_region,
                     In<int32_t, -1> rank) {
    if (!rank.size()) throw nb::value_error("a rank for none is needed");
    auto out = make_array<int32_t>({entries.shape(0)});
    nb::gil_scoped_release released;
    const std::size_t none = rank.shape(0) - 1;
    for (std::size_t i = 0; i < entries.shape(0); ++i) {
        const int32_t mode = mode_of_region.data()[of_entry.data()[entries.data()[i]]];
        out.data()[i] = rank.data()[mode < 0 ? none : static_cast<std::size_t>(mode)];
    }
    return out;
}

// Sums per mode over particles [low, high): of w x x' (8, 8), less its lower left quarter, for x = (1, position,
// quaternion), relative to the mode's reference and on its quaternion's side; and their number.
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
        for (std::size_t a = 0; a < kCoordinates; ++a) {  // the lower left quarter is the upper right one, turned
            double* row = sum + kCoordinates * a;
            if (a < kQuad) store_quad(row, load_quad(row) + w * x[a] * first);
            store_quad(row + kQuad, load_quad(row + kQuad) + w * x[a] * last);
        }
        sum[kSums - 1] += 1;
    }
}

// Of the sums of several ranges (C, m, 65): order (m,) by falling mass; and in that order references (m, 7) without the
// fourth place of a record, masses, numbers of particles, and means (m, 8, 8).
nb::tuple mode_moments(In<double, -1, -1, kSums> partial, In<double, -1, kRecord> reference) {
    const std::size_t ranges = partial.shape(0), n = partial.shape(1);
    if (reference.shape(0) != n) throw nb::value_error("sums and references of different sizes");
    std::vector<double> total(n * kSums);
    for (std::size_t c = 0; c < ranges; ++c)
        for (std::size_t i = 0; i < total.size(); ++i) total[i] += partial.data()[c * total.size() + i];
    std::vector<int64_t> order(n), count(n);
    std::vector<double> mass(n);
    std::iota(order.begin(), order.end(), int64_t{0});
    for (std::size_t k = 0; k < n; ++k) mass[k] = total[kSums * k];
    sort_by(order, mass);
    std::sort(mass.begin(), mass.end(), std::greater<>());
    auto place = make_array<double>({n, 7}), square = make_array<double>({n, kCoordinates, kCoordinates});
    for (std::size_t k = 0; k < n; ++k) {
        const double *sums = &total[kSums * order[k]], *record = reference.data() + kRecord * order[k];
        std::copy_n(record, 3, place.data() + 7 * k), std::copy_n(record + 4, 4, place.data() + 7 * k + 3);
        count[k] = static_cast<int64_t>(sums[kSums - 1]);
        const double whole = std::max(mass[k], std::numeric_limits<double>::min());
        double* mean = square.data() + (kSums - 1) * k;
        for (std::size_t i = 0; i + 1 < kSums; ++i) mean[i] = sums[i] / whole;
        for (std::size_t a = kQuad; a < kCoordinates; ++a)
            for (std::size_t b = 0; b < kQuad; ++b) mean[kCoordinates * a + b] = mean[kCoordinates * b + a];
    }
    return nb::make_tuple(copy_of(order), place, copy_of(mass), copy_of(count), square);
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

// Poses (m, 4, 4) and covariances (m, 6, 6) of modes from their moments, the means of x x' of x = (1, position,
// quaternion). The mean rotation is Markley's (2007); a deviation is the vector 2 vec(q mean^-1), which is linear in q.
nb::tuple gaussians(In<double, -1, 7> reference, In<double, -1, kCoordinates, kCoordinates> square) {
    const std::size_t n = reference.shape(0);
    if (square.shape(0) != n) throw nb::value_error("moments of different numbers of modes");
    auto poses = make_array<double>({n, 4, 4}), covariance = make_array<double>({n, 6, 6});
    for (std::size_t k = 0; k < n; ++k) {
        const double *origin = reference.data() + 7 * k, *u = origin + 3;
        const double* moments = square.data() + kCoordinates * kCoordinates * k;
        double t[3], q[4], tt[9], tq[12], qq[16];
        for (int a = 0; a < 3; ++a) {
            const double* row = moments + kCoordinates * (1 + a);
            t[a] = moments[1 + a];
            std::copy_n(row + 1, 3, tt + 3 * a);
            std::copy_n(row + 4, 4, tq + 4 * a);
        }
        for (int a = 0; a < 4; ++a) {
            q[a] = moments[4 + a];
            std::copy_n(moments + kCoordinates * (4 + a) + 4, 4, qq + 4 * a);
        }
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
    m.def("cluster_regions", &cluster_regions, named("mass"), named("start"), named("neighbours"), named("centres"),
          nb::arg("squared_radius"), nb::arg("least_mass"), nb::arg("most_regions"), nb::arg("most_modes"),
          "Peaks (m,) of the modes, heaviest first, and the mode (K,) of each region of that mass, -1 for none.");
    m.def("members", &members, named("entries"), named("of_entry"), named("mode_of_region"), named("rank"),
          "rank of the mode of each particle's entry; the last one where that is -1.");
    m.def("occupied_regions", &occupied_regions, named("of_entry"), named("entries"), nb::arg("count"),
          "How many of `count` regions the entries belong to.");
    m.def("region_mass", &region_mass, named("of_entry"), named("entries"), named("weights"), nb::arg("count"),
          "Mass (count,) of each region: the sum of the weights of the particles whose entries belong to it.");
    m.def("sum_modes", &sum_modes, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"),
          named("entries"), named("weights"), named("of_entry"), named("mode_of_region"), named("reference"),
          named("out"), "Add to (m, 65), for each mode over the particles [low, high): w x x' (8, 8) of x = (1, position, "
          "quaternion), relative to the reference; and their number.");
    m.def("mode_moments", &mode_moments, named("partial"), named("reference"),
          "Order (m,) by falling mass of the sums (C, m, 65) of several ranges; and in that order references (m, 7), "
          "masses, numbers of particles, and means (m, 8, 8).");
    m.def("gaussians", &gaussians, named("reference"), named("square"),
          "Poses (m, 4, 4) and covariances (m, 6, 6), fixed axes, of modes from their moments.");
}
