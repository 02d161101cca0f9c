// The codebook's entries as a graph: the one nearest to each particle, by walking along its links.
#include "arrays.hpp"
#include "huge_pages.hpp"
#include "parallel.hpp"
#include "pose_distance.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace {

constexpr int kHops = 16;
constexpr std::size_t kGlance = 3;    // times eight links are looked at before the walk goes on to the nearest of them
constexpr float kDetour = 1.2f;       // a link is left out if the way over another one is shorter by this factor
constexpr std::size_t kPrefetch = 8;  // particles ahead whose entry is fetched: a walk waits for memory

// The length of a row in whole vectors.
std::size_t padded(std::size_t count) {
    return (count + kLanes - 1) / kLanes * kLanes;
}

class PoseGraph {
public:
    PoseGraph(In<float, -1, kRecord> records, In<int32_t, -1, -1> links)
        : size_(records.shape(0)), links_(padded(links.shape(1))) {
        const std::size_t count = links.shape(1);
        if (links.shape(0) != size_) throw nb::value_error("records and links of different sizes");
        nb::gil_scoped_release released;
        keep_records(records.data());
        link_.resize(size_ * links_), reach_.resize(size_ * batches());
        std::vector<std::pair<float, int32_t>> sorted(count);
        for (std::size_t i = 0; i < size_; ++i) {
            const int32_t* to = links.data() + i * count;
            const float* here = records.data() + kRecord * i;
            for (std::size_t j = 0; j < count; ++j) {
                const float* there = records.data() + kRecord * static_cast<std::size_t>(checked(to[j]));
                sorted[j] = {std::sqrt(std::max(squared_pose_distance(here, here + 4, there), 0.0f)), to[j]};
            }
            std::sort(sorted.begin(), sorted.end());
            for (std::size_t j = 0; j < links_; ++j)
                link_[i * links_ + j] = j < count ? sorted[j].second : static_cast<int32_t>(i);
            for (std::size_t b = 0; b < batches(); ++b) reach_[i * batches() + b] = sorted[kLanes * b].first;
        }
    }

    void walk(std::size_t low, std::size_t high, In<float, -1, 3> positions, In<float, -1, 4> quaternions,
              InOut<int32_t, -1> entries, InOut<float, -1> distance) const {
        check(low, high, {positions.shape(0), quaternions.shape(0), entries.shape(0), distance.shape(0)},
              entries.data());
        nb::gil_scoped_release released;
        for (std::size_t i = low; i < high; ++i) {
            prefetch(entries.data()[std::min(i + kPrefetch, high - 1)]);
            const Query query(*this, positions.data() + 3 * i, quaternions.data() + 4 * i);
            const int32_t entry = nearest(query, entries.data()[i]);
            entries.data()[i] = entry;
            distance.data()[i] = std::sqrt(std::max(query.squared_distance(record(entry)), 0.0f));
        }
    }

private:
    // A pose, laid out so that one product with a record holds all of their distance.
    struct Query {
        Query(const PoseGraph& graph, const float* position, const float* quaternion) {
            float t[3], squared = 0;
            for (int a = 0; a < 3; ++a) t[a] = position[a] - graph.centre_[a], squared += t[a] * t[a];
            pose = Lanes{t[0], t[1], t[2], 1, quaternion[0], quaternion[1], quaternion[2], quaternion[3]};
            constant = squared + 4 * kRotationScale * kRotationScale;
        }

        float squared_distance(const float* record) const {
            const Lanes product = pose * load(record);
            const float dot = product[4] + product[5] + product[6] + product[7];
            return constant - 2 * (product[0] + product[1] + product[2] + product[3]) -
                   4 * kRotationScale * kRotationScale * dot * dot;
        }

        // To eight entries at once.
        Lanes squared_distances(const PoseGraph& graph, const int32_t* entries) const {
            Lanes product[kLanes];
            for (int l = 0; l < kLanes; ++l) product[l] = pose * load(graph.record(entries[l]));
            const Lanes first = add_pairs(add_pairs(product[0], product[1]), add_pairs(product[2], product[3]));
            const Lanes last = add_pairs(add_pairs(product[4], product[5]), add_pairs(product[6], product[7]));
            const Lanes positions = SHUFFLE(first, last, 0, 1, 2, 3, 8, 9, 10, 11);
            const Lanes turns = SHUFFLE(first, last, 4, 5, 6, 7, 12, 13, 14, 15);
            return constant - 2 * positions - 4 * kRotationScale * kRotationScale * turns * turns;
        }

        Lanes pose;
        float constant;
    };

    std::size_t batches() const { return links_ / kLanes; }

    const float* record(std::size_t entry) const { return &records_[kRecord * entry]; }

    void prefetch(int32_t entry) const {
        __builtin_prefetch(record(entry));
        __builtin_prefetch(&link_[links_ * entry]);
        __builtin_prefetch(&reach_[batches() * entry]);
    }

    int32_t checked(int32_t entry) const {
        if (entry < 0 || static_cast<std::size_t>(entry) >= size_) throw nb::value_error("an entry that is not there");
        return entry;
    }

    void check(std::size_t low, std::size_t high, std::initializer_list<std::size_t> sizes,
               const int32_t* entries) const {
        if (low > high || high > std::min(sizes)) throw nb::value_error("range beyond the particles");
        for (std::size_t i = low; i < high; ++i) checked(entries[i]);
    }

    // Positions relative to their mean; in the fourth place what completes the square: |t - t'|^2 is
    // |t|^2 - 2 (t.t' - |t'|^2 / 2).
    void keep_records(const float* records) {
        double mean[3] = {};
        for (std::size_t i = 0; i < size_; ++i)
            for (int a = 0; a < 3; ++a) mean[a] += records[kRecord * i + a] / static_cast<double>(size_);
        std::copy_n(mean, 3, centre_);
        records_.assign(records, records + kRecord * size_);
        for (std::size_t i = 0; i < size_; ++i) {
            float* record = &records_[kRecord * i];
            for (int a = 0; a < 3; ++a) record[a] -= centre_[a];
            record[3] = -0.5f * (record[0] * record[0] + record[1] * record[1] + record[2] * record[2]);
        }
    }

    int32_t nearest(const Query& query, int32_t best) const {
        float least = query.squared_distance(record(best));
        for (int hop = 0; hop < kHops; ++hop) {
            const std::size_t here = static_cast<std::size_t>(best);
            // The distance is that of points in Euclidean space: what is twice as far from here as the pose is,
            // cannot be nearer to the pose.
            const float farthest = 2 * std::sqrt(std::max(least, 0.0f));
            for (std::size_t b = 0; b < batches() && reach_[here * batches() + b] < farthest; ++b) {
                const int32_t* to = &link_[here * links_ + kLanes * b];
                const Lanes squared = query.squared_distances(*this, to);
                if (!any(squared < least)) continue;
                for (int l = 0; l < kLanes; ++l)
                    if (squared[l] < least) least = squared[l], best = to[l];
                if (b + 1 >= kGlance) break;
            }
            if (static_cast<std::size_t>(best) == here) break;
        }
        return best;
    }

    std::size_t size_, links_;  // entries, and the length of their padded rows
    float centre_[3];
    Table<float> records_;
    Table<int32_t> link_;  // shortest first
    Table<float> reach_;   // the shortest link of each eight
};

// Links (M, count) from the nearest entries (M, C), nearest first, at their distances (M, C).
// A candidate is passed over if one of the links taken is that much nearer to it than the entry is: the walk gets
// there through that link. What is left of `count` is filled up with the nearest ones passed over.
Out<int32_t> choose_links(In<float, -1, -1> features, In<int32_t, -1, -1> index, In<float, -1, -1> distance,
                          std::size_t count) {
    const std::size_t n = index.shape(0), candidates = index.shape(1), dimension = features.shape(1);
    if (count > candidates || distance.shape(0) != n || distance.shape(1) != candidates || features.shape(0) != n)
        throw nb::value_error("features, index and distance of different sizes, or fewer candidates than links");
    auto links = make_array<int32_t>({n, count});
    {
        nb::gil_scoped_release released;
        parallel_for(n, 1024, [&](std::size_t first, std::size_t last) {
            std::vector<std::size_t> passed_over;
            for (std::size_t i = first; i < last; ++i) {
                int32_t* to = links.data() + i * count;
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
                        to[taken++] = candidate[j];
                }
                for (std::size_t k = 0; taken < count; ++k) to[taken++] = candidate[passed_over[k]];
            }
        });
    }
    return links;
}

// Distances (M, K) [m] from each entry to others (M, K).
Out<float> pose_distances(In<float, -1, kRecord> records, In<int32_t, -1, -1> others) {
    const std::size_t n = records.shape(0), k = others.shape(1);
    if (others.shape(0) != n) throw nb::value_error("records and others of different sizes");
    for (std::size_t i = 0; i < others.size(); ++i)
        if (others.data()[i] < 0 || static_cast<std::size_t>(others.data()[i]) >= n)
            throw nb::value_error("an entry that is not there");
    auto out = make_array<float>({n, k});
    for (std::size_t i = 0; i < n; ++i) {
        const float* here = records.data() + kRecord * i;
        for (std::size_t j = 0; j < k; ++j) {
            const float* there = records.data() + kRecord * static_cast<std::size_t>(others.data()[i * k + j]);
            out.data()[i * k + j] = std::sqrt(std::max(squared_pose_distance(here, here + 4, there), 0.0f));
        }
    }
    return out;
}

}  // namespace

void bind_pose_graph(nb::module_& m) {
    nb::class_<PoseGraph>(m, "PoseGraph", "Entries of a codebook with their links.")
        .def(nb::init<In<float, -1, kRecord>, In<int32_t, -1, -1>>(), named("records"), named("links"))
        .def("walk", &PoseGraph::walk, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"),
             named("entries"), named("distance"),
             "Move `entries` [low, high) along the links to the entry nearest to each pose; its distance [m].");
    m.def("choose_links", &choose_links, named("features"), named("index"), named("distance"), nb::arg("count"),
          "Links (M, count) in all directions from the nearest entries (M, C) at their distances.");
    m.def("pose_distances", &pose_distances, named("records"), named("others"),
          "Distances (M, K) [m] from each entry to others (M, K).");
}
