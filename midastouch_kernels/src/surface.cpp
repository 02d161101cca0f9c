// Signed distance to the surface, interpolated between the nodes of a grid.
#include "arrays.hpp"

namespace {

void interpolate_grid(std::size_t low, std::size_t high, In<float, -1, 3> positions, In<int16_t, -1, -1, -1> values,
                      In<float, 3> origin, float per_metre, float unit, float limit, InOut<float, -1> out) {
    if (low > high || high > positions.shape(0) || high > out.shape(0))
        throw nb::value_error("range beyond the particles");
    nb::gil_scoped_release released;
    const int ny = static_cast<int>(values.shape(1)), nz = static_cast<int>(values.shape(2));
    const float last[3] = {static_cast<float>(values.shape(0)) - 1, static_cast<float>(ny) - 1,
                           static_cast<float>(nz) - 1};
    const float* o = origin.data();
    const std::size_t dx = static_cast<std::size_t>(ny) * nz, dy = nz;
    for (std::size_t i = low; i < high; ++i) {
        const float* p = positions.data() + 3 * i;
        const float x = (p[0] - o[0]) * per_metre, y = (p[1] - o[1]) * per_metre, z = (p[2] - o[2]) * per_metre;
        if (!(x >= 0 && y >= 0 && z >= 0 && x < last[0] && y < last[1] && z < last[2])) {
            out.data()[i] = limit;
            continue;
        }
        const int ix = static_cast<int>(x), iy = static_cast<int>(y), iz = static_cast<int>(z);
        const float fx = x - ix, fy = y - iy, fz = z - iz, gx = 1 - fx, gy = 1 - fy, gz = 1 - fz;
        const int16_t* v = values.data() + ix * dx + iy * dy + iz;
        const float near = gy * (gz * v[0] + fz * v[1]) + fy * (gz * v[dy] + fz * v[dy + 1]);
        const float far = gy * (gz * v[dx] + fz * v[dx + 1]) + fy * (gz * v[dx + dy] + fz * v[dx + dy + 1]);
        out.data()[i] = (gx * near + fx * far) * unit;
    }
}

}  // namespace

void bind_surface(nb::module_& m) {
    m.def("interpolate_grid", &interpolate_grid, nb::arg("low"), nb::arg("high"), named("positions"), named("values"),
          named("origin"), nb::arg("per_metre"), nb::arg("unit"), nb::arg("limit"), named("out"),
          "Values (X, Y, Z) times unit at positions [low, high) [m], trilinear; limit outside the grid.");
}
