// Systematic resampling.
#include "arrays.hpp"

#include <numeric>

namespace {

Out<int64_t> systematic(In<double, -1> weights, std::size_t n, double offset) {
    if (!weights.size()) throw nb::value_error("no weights");
    auto out = make_array<int64_t>({n});
    nb::gil_scoped_release released;
    const double* w = weights.data();
    std::size_t last = weights.size() - 1;
    while (last > 0 && w[last] == 0) --last;
    const double total = std::accumulate(w, w + weights.size(), 0.0);
    std::size_t j = 0;
    double cumulative = w[0];
    for (std::size_t i = 0; i < n; ++i) {
        const double target = (i + offset) / n * total;
        while (cumulative <= target && j < last) cumulative += w[++j];
        out.data()[i] = static_cast<int64_t>(j);
    }
    return out;
}

}  // namespace

void bind_resampling(nb::module_& m) {
    m.def("systematic", &systematic, named("weights"), nb::arg("n"), nb::arg("offset"),
          "n ancestors, ascending, of weights (N,) at equal steps of their sum, the first at `offset` in [0, 1).");
}
