// How alike a code is to those of the codebook, and what particles weigh for it.
#include "arrays.hpp"
#include "lanes.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

void dot_rows(std::size_t low, std::size_t high, In<float, -1, -1> codes, In<int64_t, -1> rows, In<float, -1> code,
              InOut<float, -1> out) {
    const std::size_t n = codes.shape(1);
    if (low > high || high > rows.shape(0) || high > out.shape(0) || code.shape(0) != n)
        throw nb::value_error("range beyond the rows, or a code of another length");
    nb::gil_scoped_release released;
    for (std::size_t i = low; i < high; ++i) {
        const float *row = codes.data() + n * static_cast<std::size_t>(rows.data()[i]), *c = code.data();
        Lanes even{}, odd{};  // so that additions need not wait for each other
        std::size_t j = 0;
        for (; j + 2 * kLanes <= n; j += 2 * kLanes) {
            even += load(row + j) * load(c + j);
            odd += load(row + j + kLanes) * load(c + j + kLanes);
        }
        double total = sum(even + odd);
        for (; j < n; ++j) total += row[j] * c[j];
        out.data()[i] = static_cast<float>(total);
    }
}

// Whether each entry (M,) is one that particles lie at or one of the `count` nearest neighbours of these, and those
// that are, ascending.
nb::tuple occupied_entries(In<int32_t, -1> entries, In<int32_t, -1, -1> neighbours, std::size_t count) {
    const std::size_t n = neighbours.shape(0), k = neighbours.shape(1);
    if (count > k) throw nb::value_error("more neighbours than there are");
    auto occupied = make_array<bool>({n});
    bool* taken = occupied.data();
    std::vector<uint8_t> lies(n);
    for (std::size_t i = 0; i < entries.shape(0); ++i) {
        const std::size_t entry = static_cast<std::size_t>(entries.data()[i]);
        if (entry >= n) throw nb::value_error("an entry that is not there");
        if (lies[entry]) continue;
        lies[entry] = taken[entry] = true;
        for (std::size_t j = 0; j < count; ++j) taken[neighbours.data()[k * entry + j]] = true;
    }
    auto out = make_array<int64_t>({static_cast<std::size_t>(std::count(taken, taken + n, true))});
    int64_t* next = out.data();
    for (std::size_t i = 0; i < n; ++i)
        if (taken[i]) *next++ = static_cast<int64_t>(i);
    return nb::make_tuple(occupied, out);
}

// Bayes' rule in logarithms: log_weights = belief + tempered, normalised, and the weights; returns the logarithms of
// the sums of exp(belief + evidence) and of exp(belief + tempered), -inf if every particle is ruled out.
nb::tuple reweigh(In<double, -1> belief, In<double, -1> evidence, In<double, -1> tempered,
                  InOut<double, -1> log_weights, InOut<double, -1> weights) {
    const std::size_t n = belief.size();
    if (evidence.size() != n || tempered.size() != n || log_weights.size() != n || weights.size() != n)
        throw nb::value_error("arrays of different sizes");
    double plain, total;
    {
        nb::gil_scoped_release released;
        double top = -INFINITY, highest = -INFINITY;
        for (std::size_t i = 0; i < n; ++i) {
            top = std::max(top, belief.data()[i] + evidence.data()[i]);
            const double value = log_weights.data()[i] = belief.data()[i] + tempered.data()[i];
            highest = std::max(highest, value);
        }
        double sum_plain = 0, sum_tempered = 0;
        for (std::size_t i = 0; i < n; i += kLanes) {
            const std::size_t here = std::min<std::size_t>(kLanes, n - i);
            Lanes a = all(-INFINITY), b = all(-INFINITY);
            for (std::size_t l = 0; l < here; ++l) {
                a[l] = static_cast<float>(belief.data()[i + l] + evidence.data()[i + l] - top);
                b[l] = static_cast<float>(log_weights.data()[i + l] - highest);
            }
            a = exp_nonpositive(a), b = exp_nonpositive(b);
            sum_plain += sum(a), sum_tempered += sum(b);
            for (std::size_t l = 0; l < here; ++l) weights.data()[i + l] = b[l];
        }
        plain = std::isfinite(top) ? top + std::log(sum_plain) : top;
        total = std::isfinite(highest) ? highest + std::log(sum_tempered) : highest;
        for (std::size_t i = 0; i < n; ++i) log_weights.data()[i] -= total, weights.data()[i] /= sum_tempered;
    }
    return nb::make_tuple(plain, total);
}

}  // namespace

void bind_measurement(nb::module_& m) {
    m.def("dot_rows", &dot_rows, nb::arg("low"), nb::arg("high"), named("codes"), named("rows"), named("code"),
          named("out"), "Dot product with a code (D,) of each of `rows` [low, high) of codes (M, D).");
    m.def("occupied_entries", &occupied_entries, named("entries"), named("neighbours"), nb::arg("count"),
          "Whether each entry (M,) is one that particles lie at or one of the `count` nearest neighbours of these; and "
          "those that are, ascending.");
    m.def("reweigh", &reweigh, named("belief"), named("evidence"), named("tempered"), named("log_weights"),
          named("weights"),
          "log_weights = belief + tempered, normalised, and weights; returns the logarithms of the sums of "
          "exp(belief + evidence) and exp(belief + tempered).");
}
