// Groups of codebook entries that lie near each other.
#include "arrays.hpp"
#include "pose_distance.hpp"

#include <algorithm>
#include <vector>

namespace {

// Take the first entry left as a centre and everything left within the radius of it, until nothing is left. What lies
// within the radius is reached through the neighbour graph.
nb::tuple cover_regions(In<float, -1, kRecord> records, In<int32_t, -1, -1> neighbours, float squared_radius) {
    const std::size_t n = records.shape(0), k = neighbours.shape(1);
    if (neighbours.shape(0) != n) throw nb::value_error("records and neighbours of different sizes");
    auto of_entry = make_array<int32_t>({n});
    int32_t* region = of_entry.data();
    std::fill_n(region, n, -1);
    std::vector<int32_t> centres;
    {
        nb::gil_scoped_release released;
        std::vector<int32_t> stack;
        for (std::size_t i = 0; i < n; ++i) {
            if (region[i] >= 0) continue;
            const float* c = records.data() + kRecord * i;
            const int32_t number = static_cast<int32_t>(centres.size());
            region[i] = number;
            centres.push_back(static_cast<int32_t>(i));
            stack.assign(1, static_cast<int32_t>(i));
            while (!stack.empty()) {
                const int32_t* around = neighbours.data() + k * stack.back();
                stack.pop_back();
                for (std::size_t j = 0; j < k; ++j) {
                    if (region[around[j]] >= 0) continue;
                    const float* there = records.data() + kRecord * around[j];
                    if (squared_pose_distance(c, c + 4, there) > squared_radius) continue;
                    region[around[j]] = number;
                    stack.push_back(around[j]);
                }
            }
        }
    }
    auto centre = make_array<int32_t>({centres.size()});
    std::copy(centres.begin(), centres.end(), centre.data());
    return nb::make_tuple(of_entry, centre);
}

}  // namespace

void bind_regions(nb::module_& m) {
    m.def("cover_regions", &cover_regions, named("records"), named("neighbours"), nb::arg("squared_radius"),
          "Region (M,) of each entry, and the entry (K,) in the middle of each region.");
}
