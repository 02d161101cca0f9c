// What a code says about codebook entries and, interpolated between them, about particles.
#include "arrays.hpp"
#include "pose_distance.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace {

constexpr std::size_t kMostNeighbours = 32;
constexpr std::size_t kPrefetch = 4;

// e^x for x <= 0, to 2e-7 of its value, in a form that compilers vectorise; 0 below -87.
inline float exp_nonpositive(float x) {
    x = std::max(x, -87.0f);
    const float halves = x * 1.44269504f, whole = std::nearbyint(halves);
    // x - whole ln 2, ln 2 in two parts (Cody and Waite 1980)
    const float r = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
    float p = 1.9875691500e-4f;
    p = p * r + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * r * r + r + 1.0f;
    const int32_t bits = (static_cast<int32_t>(whole) + 127) << 23;
    float power;
    std::memcpy(&power, &bits, sizeof(power));
    return p * power;
}

void interpolate_entries(std::size_t low, std::size_t high, In<float, -1, 3> positions, In<float, -1, 4> quaternions,
                         In<int32_t, -1> entries, In<float, -1, kRecord> records, In<int32_t, -1, -1> neighbours,
                         std::size_t count, float rate, In<float, -1> log_ratio, InOut<float, -1> out) {
    const std::size_t k = neighbours.shape(1), m = records.shape(0);
    if (low > high || high > positions.shape(0) || high > quaternions.shape(0) || high > entries.shape(0) ||
        high > out.shape(0))
        throw nb::value_error("range beyond the particles");
    if (count > std::min(k, kMostNeighbours) || neighbours.shape(0) != m || log_ratio.shape(0) != m)
        throw nb::value_error("records, neighbours and log_ratio of different sizes, or too few neighbours");
    nb::gil_scoped_release released;
    const std::size_t last = high ? high - 1 : 0;
    for (std::size_t i = low; i < high; ++i) {
        const std::size_t ahead = static_cast<std::size_t>(entries.data()[std::min(i + kPrefetch, last)]);
        __builtin_prefetch(neighbours.data() + k * ahead);
        const float *t = positions.data() + 3 * i, *q = quaternions.data() + 4 * i;
        const std::size_t entry = static_cast<std::size_t>(entries.data()[i]);
        const int32_t* other = neighbours.data() + k * entry;
        const float nearest = squared_pose_distance(t, q, records.data() + kRecord * entry);
        float weight[kMostNeighbours], value[kMostNeighbours];
        for (std::size_t j = 0; j < count; ++j) {
            weight[j] = squared_pose_distance(t, q, records.data() + kRecord * static_cast<std::size_t>(other[j]));
            value[j] = log_ratio.data()[other[j]];
        }
        // relative to the nearest entry, so that a particle far from all of them still gets a weight; one that has
        // not reached its nearest entry yet must not overflow
        for (std::size_t j = 0; j < count; ++j) weight[j] = exp_nonpositive(rate * std::max(weight[j] - nearest, 0.0f));
        float total = 1, weighted = log_ratio.data()[entry];
        for (std::size_t j = 0; j < count; ++j) total += weight[j], weighted += weight[j] * value[j];
        out.data()[i] = weighted / total;
    }
}

void dot_rows(std::size_t low, std::size_t high, In<float, -1, -1> codes, In<int64_t, -1> rows, In<float, -1> code,
              InOut<float, -1> out) {
    const std::size_t n = codes.shape(1);
    if (low > high || high > rows.shape(0) || high > out.shape(0) || code.shape(0) != n)
        throw nb::value_error("range beyond the rows, or a code of another length");
    nb::gil_scoped_release released;
    constexpr std::size_t kLanes = 16;  // partial sums, so that additions need not wait for each other
    for (std::size_t i = low; i < high; ++i) {
        const float *row = codes.data() + n * static_cast<std::size_t>(rows.data()[i]), *c = code.data();
        float sums[kLanes] = {};
        std::size_t j = 0;
        for (; j + kLanes <= n; j += kLanes)
            for (std::size_t k = 0; k < kLanes; ++k) sums[k] += row[j + k] * c[j + k];
        float total = 0;
        for (; j < n; ++j) total += row[j] * c[j];
        for (float sum : sums) total += sum;
        out.data()[i] = total;
    }
}

}  // namespace

void bind_measurement(nb::module_& m) {
    m.def("interpolate_entries", &interpolate_entries, nb::arg("low"), nb::arg("high"), named("positions"),
          named("quaternions"), named("entries"), named("records"), named("neighbours"), nb::arg("count"),
          nb::arg("rate"), named("log_ratio"), named("out"),
          "log_ratio (M,) at poses [low, high), a mean over each one's entry and its `count` nearest, weighed by "
          "exp(rate d^2).");
    m.def("dot_rows", &dot_rows, nb::arg("low"), nb::arg("high"), named("codes"), named("rows"), named("code"),
          named("out"), "Dot product with a code (D,) of each of `rows` [low, high) of codes (M, D).");
}
