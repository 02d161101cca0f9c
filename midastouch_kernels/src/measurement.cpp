// How alike a code is to those of the codebook, and what particles weigh for it.
#include "arrays.hpp"
#include "lanes.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

constexpr std::size_t kPrefetch = 8;  // rows ahead that are fetched: they may lie anywhere
constexpr std::size_t kLine = 16;     // floats in a line of the cache

void dot_rows(std::size_t low, std::size_t high, In<float, -1, -1> codes, In<int64_t, -1> rows, In<float, -1> code,
              InOut<float, -1> out) {
    const std::size_t n = codes.shape(1);
    if (low > high || high > rows.shape(0) || high > out.shape(0) || code.shape(0) != n)
        throw nb::value_error("range beyond the rows, or a code of another length");
    nb::gil_scoped_release released;
    auto row_of = [&](std::size_t i) { return codes.data() + n * static_cast<std::size_t>(rows.data()[i]); };
    for (std::size_t i = low; i < high; ++i) {
        const float *row = row_of(i), *c = code.data(), *ahead = row_of(std::min(i + kPrefetch, high - 1));
        for (std::size_t j = 0; j < n; j += kLine) __builtin_prefetch(ahead + j);
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

// Entries of `size`, ascending, that particles lie at; and which of a sample of entries are none of them.
nb::tuple occupied_entries(In<int32_t, -1> entries, std::size_t size, In<int64_t, -1> sample) {
    constexpr std::size_t kBits = 64;
    std::vector<uint64_t> taken(size / kBits + 1);
    for (std::size_t i = 0; i < entries.shape(0); ++i) {
        const std::size_t entry = static_cast<std::size_t>(entries.data()[i]);
        if (entry >= size) throw nb::value_error("an entry that is not there");
        taken[entry / kBits] |= uint64_t{1} << entry % kBits;
    }
    std::vector<int64_t> rows, others;
    for (std::size_t w = 0; w < taken.size(); ++w)
        for (uint64_t word = taken[w]; word; word &= word - 1)
            rows.push_back(static_cast<int64_t>(kBits * w + __builtin_ctzll(word)));
    for (std::size_t i = 0; i < sample.shape(0); ++i) {
        const std::size_t entry = static_cast<std::size_t>(sample.data()[i]);
        if (entry >= size) throw nb::value_error("an entry that is not there");
        if (!(taken[entry / kBits] >> entry % kBits & 1)) others.push_back(static_cast<int64_t>(i));
    }
    return nb::make_tuple(copy_of(rows), copy_of(others));
}

// The largest a + b of n; -inf if there are none.
double largest_sum(const double* a, const double* b, std::size_t n) {
    Quad most = Quad{} - INFINITY;
    std::size_t i = 0;
    for (; i + kQuad <= n; i += kQuad) {
        const Quad sum = load_quad(a + i) + load_quad(b + i);
        most = most < sum ? sum : most;
    }
    double out = std::max({most[0], most[1], most[2], most[3]});
    for (; i < n; ++i) out = std::max(out, a[i] + b[i]);
    return out;
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
        const double top = largest_sum(belief.data(), evidence.data(), n);
        const double highest = largest_sum(belief.data(), tempered.data(), n);
        for (std::size_t i = 0; i < n; ++i) log_weights.data()[i] = belief.data()[i] + tempered.data()[i];
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
    m.def("occupied_entries", &occupied_entries, named("entries"), nb::arg("size"), named("sample"),
          "Entries of `size`, ascending, that particles lie at; and which of a sample of entries (S,) are none of them.");
    m.def("reweigh", &reweigh, named("belief"), named("evidence"), named("tempered"), named("log_weights"),
          named("weights"),
          "log_weights = belief + tempered, normalised, and weights; returns the logarithms of the sums of "
          "exp(belief + evidence) and exp(belief + tempered).");
}
