// The codebook entry nearest to any pose, exactly: entries in a grid of cells by their position.
#include "arrays.hpp"
#include "huge_pages.hpp"
#include "lanes.hpp"
#include "pose_distance.hpp"
#include "quaternion.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

class PoseCells {
public:
    explicit PoseCells(In<float, -1, kRecord> records) : size_(records.shape(0)) {
        if (!size_ || size_ > INT32_MAX) throw nb::value_error("cells need at least one entry, and at most 2^31");
        nb::gil_scoped_release released;
        float low[3], high[3];
        for (int a = 0; a < 3; ++a) low[a] = INFINITY, high[a] = -INFINITY;
        for (std::size_t i = 0; i < size_; ++i)
            for (int a = 0; a < 3; ++a) {
                const float value = records.data()[kRecord * i + a];
                if (!std::isfinite(value)) throw nb::value_error("an entry whose position is not finite");
                low[a] = std::min(low[a], value), high[a] = std::max(high[a], value);
            }
        const float extent = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-6f});
        cell_ = extent / std::cbrt(static_cast<float>(size_));  // on a surface many entries share a cell
        std::size_t cells = 1;
        for (int a = 0; a < 3; ++a) {
            origin_[a] = low[a];
            shape_[a] = static_cast<int>((high[a] - low[a]) / cell_) + 1;
            cells *= shape_[a];
        }
        std::vector<std::vector<int32_t>> within(cells);
        for (std::size_t i = 0; i < size_; ++i) {
            int at[3];
            for (int a = 0; a < 3; ++a) at[a] = index(a, records.data()[kRecord * i + a]);
            within[number(at)].push_back(static_cast<int32_t>(i));
        }
        start_.push_back(0);
        for (const std::vector<int32_t>& entries : within) {
            for (std::size_t k = 0; k < entries.size(); k += kLanes) keep(records.data(), entries, k);
            start_.push_back(eights_.size());
        }
    }

    Out<int32_t> nearest(In<double, -1, 4, 4> poses, double within) const {
        const std::size_t n = poses.shape(0);
        auto out = make_array<int32_t>({n});
        nb::gil_scoped_release released;
        for (std::size_t i = 0; i < n; ++i) {
            const double* pose = poses.data() + 16 * i;
            const Quaternion<double> q = from_matrix(pose, 4);
            const double position[3] = {pose[3], pose[7], pose[11]}, quaternion[4] = {q.x, q.y, q.z, q.w};
            Pose here;
            std::copy_n(position, 3, here.position), std::copy_n(quaternion, 4, here.quaternion);
            out.data()[i] = search(here, static_cast<float>(within * within));
        }
        return out;
    }

    void locate(std::size_t low, std::size_t high, In<float, -1, 3> positions, In<float, -1, 4> quaternions,
                InOut<int32_t, -1> entries) const {
        if (low > high || high > std::min({positions.shape(0), quaternions.shape(0), entries.shape(0)}))
            throw nb::value_error("range beyond the particles");
        nb::gil_scoped_release released;
        for (std::size_t i = low; i < high; ++i) {
            Pose here;
            std::copy_n(positions.data() + 3 * i, 3, here.position);
            std::copy_n(quaternions.data() + 4 * i, 4, here.quaternion);
            entries.data()[i] = search(here, INFINITY);
        }
    }

private:
    struct Pose {
        float position[3], quaternion[4];
    };
    struct Eight {
        Lanes position[3], quaternion[4];
        Mask entry;
    };
    struct Best {
        float squared;
        int32_t entry;
    };

    int index(int axis, float value) const {
        const float i = (value - origin_[axis]) / cell_;
        return i > 0 ? static_cast<int>(std::min(i, static_cast<float>(shape_[axis] - 1))) : 0;
    }

    std::size_t number(const int* at) const {
        return (static_cast<std::size_t>(at[0]) * shape_[1] + at[1]) * shape_[2] + at[2];
    }

    // How far `value` is outside the cells first to last along an axis.
    float outside(int axis, float value, int first, int last) const {
        const float low = origin_[axis] + first * cell_, high = origin_[axis] + (last + 1) * cell_;
        return std::max({0.0f, low - value, value - high});
    }

    void keep(const float* records, const std::vector<int32_t>& entries, std::size_t first) {
        Eight eight;
        for (int l = 0; l < kLanes; ++l) {
            // what is left of the last eight is the last entry once more
            const int32_t entry = entries[std::min(first + l, entries.size() - 1)];
            const float* record = records + kRecord * static_cast<std::size_t>(entry);
            for (int a = 0; a < 3; ++a) eight.position[a][l] = record[a];
            for (int a = 0; a < 4; ++a) eight.quaternion[a][l] = record[4 + a];
            eight.entry[l] = entry;
        }
        eights_.push_back(eight);
    }

    void compare(const Pose& pose, std::size_t cell, Best& best) const {
        for (std::size_t k = start_[cell]; k < start_[cell + 1]; ++k) {
            const Eight& eight = eights_[k];
            Lanes squared{}, dot{};
            for (int a = 0; a < 3; ++a) {
                const Lanes off = eight.position[a] - pose.position[a];
                squared += off * off;
            }
            for (int a = 0; a < 4; ++a) dot += eight.quaternion[a] * pose.quaternion[a];
            squared += 4 * kRotationScale * kRotationScale * (1 - dot * dot);
            if (!any(squared < best.squared)) continue;
            for (int l = 0; l < kLanes; ++l)
                if (squared[l] < best.squared) best = {squared[l], eight.entry[l]};
        }
    }

    // The entry nearest to a pose; as many as there are, if none is nearer than the bound.
    int32_t search(const Pose& pose, float squared_bound) const {
        int home[3];
        float off[3];  // the pose from the grid, squared
        for (int a = 0; a < 3; ++a) {
            home[a] = index(a, pose.position[a]);
            off[a] = outside(a, pose.position[a], 0, shape_[a] - 1);
            off[a] *= off[a];
        }
        Best best{squared_bound, static_cast<int32_t>(size_)};
        for (int radius = 0; left(pose, home, off, radius) < best.squared; ++radius) shell(pose, home, radius, best);
        return best.entry;
    }

    // Squared distance from the pose to the nearest of the cells that are `radius` or more from home; infinite if none.
    float left(const Pose& pose, const int* home, const float* off, int radius) const {
        float least = radius ? INFINITY : off[0] + off[1] + off[2];
        for (int a = 0; a < 3 && radius; ++a) {
            const float others = off[(a + 1) % 3] + off[(a + 2) % 3];
            for (const int at : {home[a] - radius, home[a] + radius}) {
                if (at < 0 || at >= shape_[a]) continue;
                const bool below = at < home[a];
                const float side = outside(a, pose.position[a], below ? 0 : at, below ? at : shape_[a] - 1);
                least = std::min(least, side * side + others);
            }
        }
        return least;
    }

    // The cells that are just `radius` from home.
    void shell(const Pose& pose, const int* home, int radius, Best& best) const {
        int first[3], last[3], at[3];
        for (int a = 0; a < 3; ++a)
            first[a] = std::max(home[a] - radius, 0), last[a] = std::min(home[a] + radius, shape_[a] - 1);
        for (at[0] = first[0]; at[0] <= last[0]; ++at[0]) {
            const float x = outside(0, pose.position[0], at[0], at[0]);
            for (at[1] = first[1]; at[1] <= last[1]; ++at[1]) {
                const float y = outside(1, pose.position[1], at[1], at[1]), aside = x * x + y * y;
                if (aside >= best.squared) continue;
                const bool face = std::abs(at[0] - home[0]) == radius || std::abs(at[1] - home[1]) == radius;
                for (at[2] = face ? first[2] : home[2] - radius; at[2] <= last[2]; at[2] += face ? 1 : 2 * radius) {
                    if (at[2] < 0) continue;
                    const float z = outside(2, pose.position[2], at[2], at[2]);
                    if (aside + z * z < best.squared) compare(pose, number(at), best);
                }
            }
        }
    }

    std::size_t size_;
    float origin_[3], cell_;
    int shape_[3];
    Table<Eight> eights_;  // those of cell c: start_[c] up to start_[c + 1]
    std::vector<std::size_t> start_;
};

}  // namespace

void bind_pose_cells(nb::module_& m) {
    nb::class_<PoseCells>(m, "PoseCells", "Entries of a codebook by their position.")
        .def(nb::init<In<float, -1, kRecord>>(), named("records"))
        .def("locate", &PoseCells::locate, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"),
             named("entries"), "Set the entries (N,) nearest to the poses [low, high).")
        .def("nearest", &PoseCells::nearest, named("poses"), nb::arg("within"),
             "Entry (N,) nearest to each pose (N, 4, 4); the number of entries where none is nearer than `within`.");
}
