// Nearest codebook entry of each particle, by walking the entries' graph of links.
#include "arrays.hpp"
#include "parallel.hpp"
#include "pose_distance.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

constexpr int kHops = 8;
constexpr float kDetour = 1.2f;       // a link is left out if the way over another one is shorter by this factor
constexpr std::size_t kPrefetch = 6;  // particles ahead whose entry is fetched: a walk waits for memory

// Entries of a codebook with links between them. The distance is that of points in Euclidean space, so an entry whose
// shortest link is longer than twice the distance of a pose to the entry is the pose's nearest one.
class LinkGraph {
public:
    LinkGraph(In<float, -1, kRecord> records, In<int32_t, -1, -1> links, In<float, -1, -1> lengths)
        : records_(records.data(), records.data() + records.size()), count_(links.shape(1)) {
        const std::size_t n = records.shape(0);
        if (links.shape(0) != n || lengths.shape(0) != n || lengths.shape(1) != count_)
            throw nb::value_error("records, links and lengths of different sizes");
        links_.resize(n * count_);
        for (std::size_t k = 0; k < links_.size(); ++k) {
            const int32_t to = links.data()[k];
            if (to < 0 || static_cast<std::size_t>(to) >= n) throw nb::value_error("a link to an entry that is not there");
            links_[k] = {to, lengths.data()[k]};
        }
        for (std::size_t i = 0; i < n; ++i) {
            auto* first = links_.data() + i * count_;
            std::sort(first, first + count_, [](const Link& a, const Link& b) { return a.length < b.length; });
            const float half = count_ ? 0.5f * first->length : INFINITY;
            records_[kRecord * i + 3] = half * half;
        }
    }

    void walk(std::size_t low, std::size_t high, In<float, -1, 3> positions, In<float, -1, 4> quaternions,
              InOut<int32_t, -1> entries, InOut<float, -1> distance) const {
        if (low > high || high > positions.shape(0) || high > quaternions.shape(0) || high > entries.shape(0) ||
            high > distance.shape(0))
            throw nb::value_error("range beyond the particles");
        const int32_t n = static_cast<int32_t>(records_.size() / kRecord);
        for (std::size_t i = low; i < high; ++i)
            if (entries.data()[i] < 0 || entries.data()[i] >= n) throw nb::value_error("an entry that is not there");
        nb::gil_scoped_release released;
        const std::size_t last = high ? high - 1 : 0;
        for (std::size_t i = low; i < high; ++i) {
            __builtin_prefetch(record(entries.data()[std::min(i + kPrefetch, last)]));
            const auto [entry, squared] =
                nearest(positions.data() + 3 * i, quaternions.data() + 4 * i, entries.data()[i]);
            entries.data()[i] = entry;
            distance.data()[i] = std::sqrt(std::max(squared, 0.0f));
        }
    }

private:
    struct Link {
        int32_t to;
        float length;
    };

    const float* record(int32_t entry) const { return records_.data() + kRecord * static_cast<std::size_t>(entry); }

    std::pair<int32_t, float> nearest(const float* position, const float* quaternion, int32_t best) const {
        float least = squared_pose_distance(position, quaternion, record(best));
        for (int hop = 0; hop < kHops; ++hop) {
            const int32_t here = best;
            if (least <= record(here)[3]) break;
            const float from_here = std::sqrt(std::max(least, 0.0f));
            float reach = 2 * from_here;  // a longer link leads farther away than to the best one found
            const Link* link = links_.data() + count_ * static_cast<std::size_t>(here);
            for (std::size_t j = 0; j < count_ && link[j].length < reach; ++j) {
                const float d = squared_pose_distance(position, quaternion, record(link[j].to));
                if (d < least) {
                    least = d, best = link[j].to;
                    reach = from_here + std::sqrt(std::max(d, 0.0f));
                }
            }
            if (best == here) break;
        }
        return {best, least};
    }

    std::vector<float> records_;  // [3] of each: square of half its shortest link
    std::vector<Link> links_;     // of each entry, shortest first
    std::size_t count_;
};

// Links (M, count) from the nearest entries (M, C), nearest first, at their distances (M, C), and their lengths.
// A candidate is passed over if one of the links taken is that much nearer to it than the entry is: the walk gets
// there through that link. What is left of `count` is filled up with the nearest ones passed over.
nb::tuple choose_links(In<float, -1, -1> features, In<int32_t, -1, -1> index, In<float, -1, -1> distance,
                       std::size_t count) {
    const std::size_t n = index.shape(0), candidates = index.shape(1), dimension = features.shape(1);
    if (count > candidates || distance.shape(0) != n || distance.shape(1) != candidates || features.shape(0) != n)
        throw nb::value_error("features, index and distance of different sizes, or fewer candidates than links");
    auto links = make_array<int32_t>({n, count});
    auto lengths = make_array<float>({n, count});
    {
        nb::gil_scoped_release released;
        parallel_for(n, 1024, [&](std::size_t first, std::size_t last) {
            std::vector<std::size_t> passed_over;
            for (std::size_t i = first; i < last; ++i) {
                int32_t* to = links.data() + i * count;
                float* length = lengths.data() + i * count;
                const int32_t* candidate = index.data() + i * candidates;
                const float* at = distance.data() + i * candidates;
                std::size_t taken = 0;
                passed_over.clear();
                for (std::size_t j = 0; j < candidates && taken < count; ++j) {
                    const float limit = (at[j] / kDetour) * (at[j] / kDetour);
                    const float* a = features.data() + dimension * candidate[j];
                    const bool reached = std::any_of(to, to + taken, [&](int32_t link) {
                        const float* b = features.data() + dimension * link;
                        float squared = 0;
                        for (std::size_t k = 0; k < dimension; ++k) squared += (a[k] - b[k]) * (a[k] - b[k]);
                        return squared < limit;
                    });
                    if (reached)
                        passed_over.push_back(j);
                    else
                        to[taken] = candidate[j], length[taken++] = at[j];
                }
                for (std::size_t k = 0; taken < count; ++k)
                    to[taken] = candidate[passed_over[k]], length[taken++] = at[passed_over[k]];
            }
        });
    }
    return nb::make_tuple(links, lengths);
}

}  // namespace

void bind_pose_lookup(nb::module_& m) {
    nb::class_<LinkGraph>(m, "LinkGraph", "Entries of a codebook with links between them.")
        .def(nb::init<In<float, -1, kRecord>, In<int32_t, -1, -1>, In<float, -1, -1>>(), named("records"),
             named("links"), named("lengths"))
        .def("walk", &LinkGraph::walk, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"),
             named("entries"), named("distance"),
             "Move `entries` [low, high) along the links to the entry nearest to each pose; its distance [m].");
    m.def("choose_links", &choose_links, named("features"), named("index"), named("distance"), nb::arg("count"),
          "Links (M, count) in all directions from the nearest entries (M, C) at their distances, and their lengths.");
}
