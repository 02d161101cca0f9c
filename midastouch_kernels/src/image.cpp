// Images and maps at a coarser resolution, by means over blocks of pixels.
#include "arrays.hpp"

#include <algorithm>
#include <vector>

namespace {

constexpr std::size_t kColours = 3;
constexpr float kWhite = 255;

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

// The median, of an even number of values the mean of the two in the middle; their order is lost.
float median(std::vector<float>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return values.size() % 2 ? *middle : (*std::max_element(values.begin(), middle) + *middle) / 2;
}

// An image (H, W, 3) less a background (H, W, 3), after each colour was divided by its gain, but no less than `least`:
// the median of the products of every so many pixels, along both sides, with the sparse ones. A background that would
// be white in this light is no brighter than the image can show.
Out<float> change_beside_gain(In<float, -1, -1, kColours> image, In<float, -1, -1, kColours> background,
                              In<float, -1, -1, kColours> sparse, std::size_t every, float least) {
    const std::size_t height = image.shape(0), width = image.shape(1);
    if (background.shape(0) != height || background.shape(1) != width)
        throw nb::value_error("an image and a background of different sizes");
    if (!every || !sparse.size() || sparse.shape(0) != (height + every - 1) / every ||
        sparse.shape(1) != (width + every - 1) / every)
        throw nb::value_error("sparse pixels that are not every so many of the image's");
    std::vector<float> ratios[kColours];
    const float* each = sparse.data();
    for (std::size_t v = 0; v < height; v += every)
        for (std::size_t u = 0; u < width; u += every)
            for (std::size_t c = 0; c < kColours; ++c)
                ratios[c].push_back(image.data()[(v * width + u) * kColours + c] * *each++);
    std::vector<float> gains(width * kColours), whites(gains.size());  // along a whole row: that loop is vectorised
    for (std::size_t c = 0; c < kColours; ++c) {
        const float gain = std::max(median(ratios[c]), least);
        for (std::size_t u = 0; u < width; ++u)
            gains[u * kColours + c] = gain, whites[u * kColours + c] = kWhite / gain;
    }
    auto out = make_array<float>({height, width, kColours});
    for (std::size_t v = 0; v < height; ++v) {
        const std::size_t row = v * gains.size();
        for (std::size_t i = 0; i < gains.size(); ++i)
            out.data()[row + i] = image.data()[row + i] / gains[i] - std::min(background.data()[row + i], whites[i]);
    }
    return out;
}

// Images (N, H, W, 3) times a factor as planes (N, 3, H, W).
Out<float> planes(In<float, -1, -1, -1, kColours> images, float factor) {
    const std::size_t count = images.shape(0), pixels = images.shape(1) * images.shape(2);
    auto out = make_array<float>({count, kColours, images.shape(1), images.shape(2)});
    for (std::size_t n = 0; n < count; ++n) {
        const float* from = images.data() + n * pixels * kColours;
        float* to = out.data() + n * pixels * kColours;
        for (std::size_t i = 0; i < pixels; ++i)
            for (std::size_t c = 0; c < kColours; ++c) to[c * pixels + i] = from[kColours * i + c] * factor;
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
    m.def(
        "change_beside_gain", &change_beside_gain, named("image"), named("background"), named("sparse"),
        nb::arg("every"), nb::arg("least"),
        "An image (H, W, 3) less a background, each colour first divided by its gain, at least `least`: the median of "
        "every so many pixels times the `sparse` ones. A background times its gain is white at most.");
    m.def("planes", &planes, named("images"), nb::arg("factor"), "Images (N, H, W, 3) times a factor as (N, 3, H, W).");
    m.def("block_means", &block_means, named("map"), nb::arg("rows"), nb::arg("columns"),
          "Means (H / rows, W / columns) float32 over blocks of a map (H, W) float32.");
}
