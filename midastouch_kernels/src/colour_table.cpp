// Change of colour by slope and direction of the gel: a table of quadratics in the pixel's position (Si and Yuan 2022).
#include "arrays.hpp"

#include <algorithm>
#include <cmath>

namespace {

constexpr double kRows = 480, kColumns = 640;  // of the images the table was fitted on
constexpr double kPi = 3.14159265358979323846;
constexpr int kTerms = 6, kChannels = 3;

Out<float> look_up_colours(In<float, -1, -1, kTerms, kChannels> coefficients, In<float, -1, -1> down,
                           In<float, -1, -1> right, int turns, bool mirrored) {
    const std::size_t height = down.shape(0), width = down.shape(1);
    const int slopes = static_cast<int>(coefficients.shape(0)), directions = static_cast<int>(coefficients.shape(1));
    if (right.shape(0) != height || right.shape(1) != width) throw nb::value_error("slopes of different sizes");
    if (slopes < 2 || directions < 1) throw nb::value_error("a table needs two slopes and a direction at least");
    auto out = make_array<float>({height, width, kChannels});
    nb::gil_scoped_release released;
    for (std::size_t v = 0; v < height; ++v) {
        for (std::size_t u = 0; u < width; ++u) {
            float a = down.data()[v * width + u], b = right.data()[v * width + u];
            if (a == 0 && b == 0) continue;
            double x = (u + 0.5) / width - 0.5, y = (v + 0.5) / height - 0.5;
            if (mirrored) x = -x, b = -b;
            for (int k = 0; k < turns; ++k) {
                const double last_x = x;
                const float last_a = a;
                x = y, y = -last_x, a = -b, b = last_a;
            }
            x = (x + 0.5) * kColumns, y = (y + 0.5) * kRows;
            const double row = std::atan(std::sqrt(a * a + b * b)) / (kPi / 2) * (slopes - 1);
            const double column = std::nearbyint((std::atan2(a, b) + kPi) / (2 * kPi) * (directions - 1));
            // written so that a slope that is not a number gives a colour that is none
            const int low = row > 0 ? static_cast<int>(std::min<double>(row, slopes - 2)) : 0;
            const int direction = column > 0 ? static_cast<int>(std::min<double>(column, directions - 1)) : 0;
            const float part = static_cast<float>(row - low);
            const float terms[kTerms] = {static_cast<float>(x * x), static_cast<float>(y * y),
                                         static_cast<float>(x * y), static_cast<float>(x),
                                         static_cast<float>(y),     1.0f};
            const std::size_t bin = kTerms * kChannels;
            const float* near = coefficients.data() + (static_cast<std::size_t>(low) * directions + direction) * bin;
            const float* far = near + directions * bin;
            float value[kChannels] = {};
            for (int k = 0; k < kTerms; ++k)
                for (int c = 0; c < kChannels; ++c) {
                    const int j = kChannels * k + c;
                    value[c] += (near[j] + part * (far[j] - near[j])) * terms[k];
                }
            std::copy_n(value, kChannels, out.data() + kChannels * (v * width + u));
        }
    }
    return out;
}

}  // namespace

void bind_colour_table(nb::module_& m) {
    m.def("look_up_colours", &look_up_colours, named("coefficients"), named("down"), named("right"), nb::arg("turns"),
          nb::arg("mirrored"),
          "Change of colour (H, W, 3) of a gel with slopes (H, W) down and to the right, by a table (S, D, 6, 3) whose "
          "images are the portrait ones mirrored, if asked for, and turned by quarters.");
}
