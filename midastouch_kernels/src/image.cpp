// Images and maps at a coarser resolution, by means over blocks of pixels.
#include "arrays.hpp"

#include <vector>

namespace {

constexpr std::size_t kColours = 3;

// Grey levels (H/2, W/2, 3), each pixel the mean of four of an image (H, W, 3).
Out<float> halve_image(In<uint8_t, -1, -1, kColours> image) {
    const std::size_t height = image.shape(0) / 2, width = image.shape(1) / 2, row = image.shape(1) * kColours;
    if (image.shape(0) % 2 || image.shape(1) % 2) throw nb::value_error("an image of odd size");
    auto out = make_array<float>({height, width, kColours});
    std::vector<int32_t> both(row);  // two rows added, in a loop of its own: that one is vectorised
    for (std::size_t v = 0; v < height; ++v) {
        const uint8_t *above = image.data() + 2 * v * row, *below = above + row;
        for (std::size_t i = 0; i < row; ++i) both[i] = above[i] + below[i];
        float* to = out.data() + v * width * kColours;
        for (std::size_t u = 0; u < width; ++u, to += kColours) {
            const int32_t* from = both.data() + 2 * u * kColours;
            for (std::size_t c = 0; c < kColours; ++c) to[c] = 0.25f * static_cast<float>(from[c] + from[c + kColours]);
        }
    }
    return out;
}

// Means (H / rows, W / columns) over blocks of a map (H, W).
Out<float> block_means(In<float, -1, -1> map, std::size_t rows, std::size_t columns) {
    if (!rows || !columns || map.shape(0) % rows || map.shape(1) % columns)
        throw nb::value_error("a map whose sides are no multiples of the blocks'");
    const std::size_t height = map.shape(0) / rows, width = map.shape(1) / columns;
    const float count = static_cast<float>(rows * columns);
    auto out = make_array<float>({height, width});
    const float* from = map.data();
    for (std::size_t v = 0; v < height; ++v) {
        float* to = out.data() + v * width;
        for (std::size_t i = 0; i < rows; ++i)
            for (std::size_t u = 0; u < width; ++u) {
                float sum = 0;
                for (std::size_t j = 0; j < columns; ++j) sum += *from++;
                to[u] += sum;
            }
        for (std::size_t u = 0; u < width; ++u) to[u] /= count;
    }
    return out;
}

}  // namespace

void bind_image(nb::module_& m) {
    m.def("halve_image", &halve_image, named("image"),
          "Grey levels (H/2, W/2, 3) float32 of an image (H, W, 3) uint8 of even size, each pixel the mean of four.");
    m.def("block_means", &block_means, named("map"), nb::arg("rows"), nb::arg("columns"),
          "Means (H / rows, W / columns) float32 over blocks of a map (H, W) float32.");
}
