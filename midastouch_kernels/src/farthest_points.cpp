// Farthest-point sequence (Gonzalez 1985). Points are grouped by the chosen one that is nearest to them: a new choice
// farther from a group's centre than twice the group's radius takes no point from it (triangle inequality).
#include "arrays.hpp"

#include <cmath>
#include <vector>

namespace {

// Keeps a group from being passed over for a rounding error.
constexpr double kSlack = 1 + 1e-9;

struct Group {
    std::vector<int64_t> members;
    double radius = -1;    // squared distance of the farthest member, -1 without members
    int64_t farthest = 0;  // the first of the farthest

    void add(int64_t point, double squared) {
        members.push_back(point);
        reckon(point, squared);
    }
    void reckon(int64_t point, double squared) {
        if (squared > radius || (squared == radius && point < farthest)) radius = squared, farthest = point;
    }
};

Out<int64_t> farthest_points(In<double, -1, -1> features, std::size_t count) {
    const std::size_t n = features.shape(0), dimension = features.shape(1);
    for (std::size_t i = 0; i < features.size(); ++i)
        if (!std::isfinite(features.data()[i])) throw nb::value_error("a point that is not finite");
    count = std::min(count, n);
    auto chosen = make_array<int64_t>({count});
    if (!count) return chosen;
    nb::gil_scoped_release released;
    auto squared_distance = [&](int64_t i, int64_t j) {
        const double *a = features.data() + dimension * i, *b = features.data() + dimension * j;
        double squared = 0;
        for (std::size_t k = 0; k < dimension; ++k) squared += (a[k] - b[k]) * (a[k] - b[k]);
        return squared;
    };
    std::vector<double> nearest(n);  // squared distance of each point to its group's centre
    std::vector<Group> groups(count);
    std::vector<double> centres(dimension * count), apart(count);  // coordinates after coordinates, for vector units
    for (std::size_t i = 0; i < count; ++i) {
        // among equally far ones the first
        int64_t current = 0;
        double farthest = -1;
        for (std::size_t g = 0; g < i; ++g)
            if (groups[g].radius > farthest || (groups[g].radius == farthest && groups[g].farthest < current))
                farthest = groups[g].radius, current = groups[g].farthest;
        chosen.data()[i] = current;
        Group& taken = groups[i];
        if (i == 0)
            for (std::size_t j = 0; j < n; ++j) taken.add(j, nearest[j] = squared_distance(j, current));
        const double* point = features.data() + dimension * current;
        std::fill_n(apart.begin(), i, 0.0);
        for (std::size_t k = 0; k < dimension; ++k) {
            double* coordinates = centres.data() + k * count;
            for (std::size_t g = 0; g < i; ++g) apart[g] += (coordinates[g] - point[k]) * (coordinates[g] - point[k]);
            coordinates[i] = point[k];
        }
        for (std::size_t g = 0; g < i; ++g) {
            Group& group = groups[g];
            if (apart[g] > 4 * group.radius * kSlack) continue;
            std::size_t kept = 0;
            group.radius = -1;
            for (const int64_t j : group.members) {
                const double squared = squared_distance(j, current);
                if (squared < nearest[j]) {
                    taken.add(j, nearest[j] = squared);
                } else {
                    group.members[kept++] = j;
                    group.reckon(j, nearest[j]);
                }
            }
            group.members.resize(kept);
        }
    }
    return chosen;
}

}  // namespace

void bind_farthest_points(nb::module_& m) {
    m.def("farthest_points", &farthest_points, named("features"), nb::arg("count"),
          "Indices of `count` of the points (N, D), the first one first, then the one farthest from all before it.");
}
