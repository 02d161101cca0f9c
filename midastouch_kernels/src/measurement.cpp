// How alike a code is to those of the codebook.
#include "arrays.hpp"
#include "lanes.hpp"

#include <algorithm>

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

}  // namespace

void bind_measurement(nb::module_& m) {
    m.def("dot_rows", &dot_rows, nb::arg("low"), nb::arg("high"), named("codes"), named("rows"), named("code"),
          named("out"), "Dot product with a code (D,) of each of `rows` [low, high) of codes (M, D).");
}
