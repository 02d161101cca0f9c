// Pictures of a mesh seen from afar (orthographic): its triangles, and discs on it.
#include "arrays.hpp"

#include <algorithm>
#include <cmath>

namespace {

// First and one past the last of the pixel centres i + 0.5 in [low, high], of those in [0, size).
struct Pixels {
    int first, end;
    Pixels(double low, double high, int size)
        : first(index(std::ceil(low - 0.5), size)), end(index(std::floor(high - 0.5) + 1, size)) {}

private:
    static int index(double i, int size) {
        return i > 0 ? static_cast<int>(std::min(i, static_cast<double>(size))) : 0;
    }
};

// Shading normals of the corners: the mean over the faces at the vertex (adjacent[start[v]] up to
// adjacent[start[v + 1]]) that lie within the crease angle of the corner's own.
Out<double> corner_normals(In<int32_t, -1, 3> faces, In<double, -1, 3> normals, In<double, -1, 3> weighted,
                           In<int64_t, -1> adjacent, In<int64_t, -1> start, double crease_cosine) {
    const int64_t n = faces.shape(0), vertices = static_cast<int64_t>(start.shape(0)) - 1;
    if (static_cast<int64_t>(normals.shape(0)) != n || static_cast<int64_t>(weighted.shape(0)) != n)
        throw nb::value_error("faces and normals of different sizes");
    if (vertices < 0 || start.data()[0] != 0 || start.data()[vertices] != static_cast<int64_t>(adjacent.shape(0)) ||
        !std::is_sorted(start.data(), start.data() + vertices + 1))
        throw nb::value_error("start must count the adjacent faces");
    for (std::size_t i = 0; i < faces.size(); ++i)
        if (faces.data()[i] < 0 || faces.data()[i] >= vertices) throw nb::value_error("a corner that is no vertex");
    for (std::size_t i = 0; i < adjacent.size(); ++i)
        if (adjacent.data()[i] < 0 || adjacent.data()[i] >= n) throw nb::value_error("an adjacent face that is none");
    auto out = make_array<double>({faces.shape(0), 3, 3});
    nb::gil_scoped_release released;
    for (int64_t f = 0; f < n; ++f) {
        const double* own = normals.data() + 3 * f;
        for (int c = 0; c < 3; ++c) {
            const int32_t vertex = faces.data()[3 * f + c];
            double total[3] = {};
            for (int64_t k = start.data()[vertex]; k < start.data()[vertex + 1]; ++k) {
                const double *other = normals.data() + 3 * adjacent.data()[k],
                             *weight = weighted.data() + 3 * adjacent.data()[k];
                if (own[0] * other[0] + own[1] * other[1] + own[2] * other[2] > crease_cosine)
                    for (int i = 0; i < 3; ++i) total[i] += weight[i];
            }
            const double length = std::sqrt(total[0] * total[0] + total[1] * total[1] + total[2] * total[2]);
            for (int i = 0; i < 3; ++i) out.data()[9 * f + 3 * c + i] = length > 0 ? total[i] / length : own[i];
        }
    }
    return out;
}

void draw_triangles(In<double, -1, 3, 2> corners, In<double, -1, 3> heights, In<double, -1, 3, 3> normals,
                    InOut<double, -1, -1> height_map, InOut<double, -1, -1, 3> normal_map) {
    const std::size_t n = corners.shape(0);
    const int rows = static_cast<int>(height_map.shape(0)), columns = static_cast<int>(height_map.shape(1));
    if (heights.shape(0) != n || normals.shape(0) != n)
        throw nb::value_error("corners, heights and normals of different sizes");
    if (normal_map.shape(0) != height_map.shape(0) || normal_map.shape(1) != height_map.shape(1))
        throw nb::value_error("maps of different sizes");
    nb::gil_scoped_release released;
    for (std::size_t f = 0; f < n; ++f) {
        const double* p = corners.data() + 6 * f;
        const double x0 = p[0], y0 = p[1], x1 = p[2], y1 = p[3], x2 = p[4], y2 = p[5];
        const double area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        if (!(std::abs(area) >= 1e-12)) continue;
        const Pixels across(std::min({x0, x1, x2}), std::max({x0, x1, x2}), columns);
        const Pixels along(std::min({y0, y1, y2}), std::max({y0, y1, y2}), rows);
        const double *h = heights.data() + 3 * f, *corner = normals.data() + 9 * f;
        const double per_area = 1 / area;
        for (int row = along.first; row < along.end; ++row) {
            const double y = row + 0.5;
            for (int column = across.first; column < across.end; ++column) {
                const double x = column + 0.5;
                const double b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) * per_area;
                const double c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) * per_area;
                const double a = 1 - b - c;
                if (a < -1e-9 || b < -1e-9 || c < -1e-9) continue;
                const std::size_t pixel = static_cast<std::size_t>(row) * columns + column;
                const double height = a * h[0] + b * h[1] + c * h[2];
                if (!(height > height_map.data()[pixel])) continue;
                height_map.data()[pixel] = height;
                double normal[3];
                for (int i = 0; i < 3; ++i) normal[i] = a * corner[i] + b * corner[3 + i] + c * corner[6 + i];
                const double length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
                // scans have holes and inverted faces: light every face from the viewer's side
                const double scale = (normal[2] < 0 ? -1 : 1) / std::max(length, 1e-12);
                for (int i = 0; i < 3; ++i) normal_map.data()[3 * pixel + i] = normal[i] * scale;
            }
        }
    }
}

void draw_discs(In<double, -1, 2> centres, In<double, -1> heights, In<double, -1, 3> colours, double radius,
                double alpha, double hidden_alpha, In<double, -1, -1> height_map, InOut<double, -1, -1, 3> colour_map) {
    const std::size_t n = centres.shape(0);
    const int rows = static_cast<int>(height_map.shape(0)), columns = static_cast<int>(height_map.shape(1));
    if (heights.shape(0) != n || colours.shape(0) != n)
        throw nb::value_error("centres, heights and colours of different sizes");
    if (colour_map.shape(0) != height_map.shape(0) || colour_map.shape(1) != height_map.shape(1))
        throw nb::value_error("maps of different sizes");
    nb::gil_scoped_release released;
    for (std::size_t i = 0; i < n; ++i) {
        const double x = centres.data()[2 * i], y = centres.data()[2 * i + 1], height = heights.data()[i];
        const double* colour = colours.data() + 3 * i;
        const Pixels along(y - radius, y + radius, rows);
        for (int row = along.first; row < along.end; ++row) {
            const double dy = row + 0.5 - y, half = std::sqrt(std::max(radius * radius - dy * dy, 0.0));
            const Pixels across(x - half, x + half, columns);
            const double* surface = height_map.data() + static_cast<std::size_t>(row) * columns;
            double* picture = colour_map.data() + 3 * static_cast<std::size_t>(row) * columns;
            for (int column = across.first; column < across.end; ++column) {
                const double a = height >= surface[column] ? alpha : hidden_alpha;
                for (int k = 0; k < 3; ++k) picture[3 * column + k] += a * (colour[k] - picture[3 * column + k]);
            }
        }
    }
}

}  // namespace

void bind_canvas(nb::module_& m) {
    m.def("corner_normals", &corner_normals, named("faces"), named("normals"), named("weighted"), named("adjacent"),
          named("start"), nb::arg("crease_cosine"),
          "Normals (F, 3, 3) of the corners: the mean of the `weighted` ones of the faces at the vertex, adjacent["
          "start[v]:start[v + 1]], that are within the crease angle of the corner's own.");
    m.def(
        "draw_triangles", &draw_triangles, named("corners"), named("heights"), named("normals"), named("height_map"),
        named("normal_map"),
        "Draw triangles with corners (F, 3, 2) [pixels], heights (F, 3) and normals (F, 3, 3) where they are higher.");
    m.def(
        "draw_discs", &draw_discs, named("centres"), named("heights"), named("colours"), nb::arg("radius"),
        nb::arg("alpha"), nb::arg("hidden_alpha"), named("height_map"), named("colour_map"),
        "Blend discs about centres (N, 2) [pixels] into the colours (H, W, 3), one after another; those lower than the "
        "map (H, W) with hidden_alpha.");
}
