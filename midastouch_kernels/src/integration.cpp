// Heights from slopes: least squares over a region beside which the height is nothing (Poisson's equation).
//
// Solved by conjugate gradients, preconditioned by a multigrid cycle (Tatebe 1993): as many steps for any region.
#include "arrays.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

constexpr int kSmoothings = 2;  // before and after the coarser level
constexpr int kSmoothingsAtLast = 12;
constexpr float kDamping = 0.8f;      // of Jacobi's method, which smooths best with it
constexpr std::size_t kCoarsest = 3;  // px a side
constexpr int kMostSteps = 60;
constexpr float kAccuracy = 1e-3f;  // of the first residual

// One grid, with a margin of one pixel around it, in which every value is 0.
struct Level {
    std::size_t height, width, stride;
    std::vector<float> inside;   // 1 in the region, else 0
    std::vector<float> weight;   // number of neighbours, inside the region or not
    std::vector<float> inverse;  // kDamping over it in the region, else 0
    std::vector<float> value, wanted, left;

    Level(std::size_t h, std::size_t w)
        : height(h),
          width(w),
          stride(w + 2),
          inside(stride * (h + 2)),
          weight(inside),
          inverse(inside),
          value(inside),
          wanted(inside),
          left(inside) {}

    std::size_t at(std::size_t v, std::size_t u) const { return (v + 1) * stride + u + 1; }

    // border: whether the image ends above, below, left and right of the grid; there is no neighbour there.
    void count_neighbours(const bool (&border)[4]) {
        for (std::size_t v = 0; v < height; ++v)
            for (std::size_t u = 0; u < width; ++u) {
                const int missing = (border[0] && v == 0) + (border[1] && v + 1 == height) + (border[2] && u == 0) +
                                    (border[3] && u + 1 == width);
                const std::size_t i = at(v, u);
                weight[i] = static_cast<float>(4 - missing);
                inverse[i] = missing < 4 ? inside[i] * kDamping / weight[i] : 0.0f;
            }
    }

    // The Laplacian, negated, of values that are 0 outside the region.
    void apply(const std::vector<float>& to, std::vector<float>& out) const {
        const float *x = to.data(), *m = inside.data(), *d = weight.data();
        for (std::size_t v = 0; v < height; ++v) {
            const std::size_t row = at(v, 0);
            float* y = out.data();
            for (std::size_t i = row; i < row + width; ++i)
                y[i] = m[i] * (d[i] * x[i] - x[i - 1] - x[i + 1] - x[i - stride] - x[i + stride]);
        }
    }

    void residual() {
        apply(value, left);
        for (std::size_t i = 0; i < left.size(); ++i) left[i] = wanted[i] - left[i];
    }

    void smooth(int times) {
        for (int k = 0; k < times; ++k) {
            residual();
            for (std::size_t i = 0; i < value.size(); ++i) value[i] += inverse[i] * left[i];
        }
    }
};

float dot(const std::vector<float>& a, const std::vector<float>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * b[i];
    return static_cast<float>(sum);
}

class Multigrid {
public:
    Multigrid(Level finest, const bool (&border)[4]) {
        finest.count_neighbours(border);
        levels_.push_back(std::move(finest));
        while (std::min(levels_.back().height, levels_.back().width) > kCoarsest) {
            const Level& fine = levels_.back();
            Level coarse((fine.height + 1) / 2, (fine.width + 1) / 2);
            for (std::size_t v = 0; v < fine.height; ++v)
                for (std::size_t u = 0; u < fine.width; ++u) {
                    float& covered = coarse.inside[coarse.at(v / 2, u / 2)];
                    covered = std::max(covered, fine.inside[fine.at(v, u)]);
                }
            coarse.count_neighbours(border);
            levels_.push_back(std::move(coarse));
        }
    }

    Level& finest() { return levels_.front(); }

    // Nearly the solution for `wanted` of the finest level, in its `value`.
    void cycle(std::size_t k = 0) {
        Level& fine = levels_[k];
        std::fill(fine.value.begin(), fine.value.end(), 0.0f);
        if (k + 1 == levels_.size()) {
            fine.smooth(kSmoothingsAtLast);
            return;
        }
        fine.smooth(kSmoothings);
        fine.residual();
        Level& coarse = levels_[k + 1];
        std::fill(coarse.wanted.begin(), coarse.wanted.end(), 0.0f);
        for (std::size_t v = 0; v < fine.height; ++v)
            for (std::size_t u = 0; u < fine.width; ++u)
                coarse.wanted[coarse.at(v / 2, u / 2)] += fine.left[fine.at(v, u)];
        cycle(k + 1);
        for (std::size_t v = 0; v < fine.height; ++v)
            for (std::size_t u = 0; u < fine.width; ++u) {
                const std::size_t i = fine.at(v, u);
                fine.value[i] += fine.inside[i] * coarse.value[coarse.at(v / 2, u / 2)];
            }
        fine.smooth(kSmoothings);
    }

private:
    std::vector<Level> levels_;
};

// Heights on the finest level for what it wants.
std::vector<float> solve(Multigrid& grid) {
    Level& finest = grid.finest();
    std::vector<float> residual = finest.wanted, height(residual.size()), direction(height), applied(height);
    const float enough = kAccuracy * kAccuracy * dot(residual, residual);
    float last = 0;
    for (int step = 0; step < kMostSteps && dot(residual, residual) > enough; ++step) {
        finest.wanted = residual;
        grid.cycle();
        const float now = dot(residual, finest.value), part = step ? now / last : 0.0f;
        last = now;
        for (std::size_t i = 0; i < direction.size(); ++i) direction[i] = finest.value[i] + part * direction[i];
        finest.apply(direction, applied);
        const float length = now / dot(direction, applied);
        if (!std::isfinite(length)) break;
        for (std::size_t i = 0; i < height.size(); ++i) {
            height[i] += length * direction[i];
            residual[i] -= length * applied[i];
        }
    }
    return height;
}

Out<float> integrate_slopes(In<float, -1, -1, 2> slopes, In<uint8_t, -1, -1> region, float pixel) {
    const std::size_t height = region.shape(0), width = region.shape(1);
    if (slopes.shape(0) != height || slopes.shape(1) != width) throw nb::value_error("slopes and region of two sizes");
    auto out = make_array<float>({height, width});
    nb::gil_scoped_release released;
    std::size_t top = height, bottom = 0, left = width, right = 0;  // of the region, up to but without the second ones
    std::size_t covered = 0;
    for (std::size_t v = 0; v < height; ++v)
        for (std::size_t u = 0; u < width; ++u)
            if (region.data()[v * width + u]) {
                ++covered;
                top = std::min(top, v), bottom = std::max(bottom, v + 1);
                left = std::min(left, u), right = std::max(right, u + 1);
            }
    if (top >= bottom) return out;
    const bool border[4] = {top == 0, bottom == height, left == 0, right == width};
    Level finest(bottom - top, right - left);
    const auto slope = [&](std::size_t v, std::size_t u, std::size_t c) {
        const float value = slopes.data()[2 * (v * width + u) + c];
        return std::isfinite(value) ? value : 0.0f;
    };
    for (std::size_t v = top; v < bottom; ++v)
        for (std::size_t u = left; u < right; ++u) {
            if (!region.data()[v * width + u]) continue;
            // steps from each neighbour to here: a slope holds half way between two pixels
            float steps = 0;
            if (u > 0) steps += slope(v, u - 1, 0) + slope(v, u, 0);
            if (u + 1 < width) steps -= slope(v, u, 0) + slope(v, u + 1, 0);
            if (v > 0) steps += slope(v - 1, u, 1) + slope(v, u, 1);
            if (v + 1 < height) steps -= slope(v, u, 1) + slope(v + 1, u, 1);
            const std::size_t i = finest.at(v - top, u - left);
            finest.inside[i] = 1;
            finest.wanted[i] = 0.5f * pixel * steps;
        }
    Multigrid grid(std::move(finest), border);
    const std::vector<float> found = solve(grid);
    // where nothing is beside the region its heights are known but for a constant: the lowest is nothing
    float lowest = 0;
    if (covered == height * width) {
        lowest = std::numeric_limits<float>::max();
        for (std::size_t v = 0; v < height; ++v)
            for (std::size_t u = 0; u < width; ++u) lowest = std::min(lowest, found[grid.finest().at(v, u)]);
    }
    for (std::size_t v = top; v < bottom; ++v)
        for (std::size_t u = left; u < right; ++u)
            out.data()[v * width + u] = found[grid.finest().at(v - top, u - left)] - lowest;
    return out;
}

}  // namespace

void bind_integration(nb::module_& m) {
    m.def("integrate_slopes", &integrate_slopes, named("slopes"), named("region"), nb::arg("pixel"),
          "Heights (H, W) float32 m, 0 outside a region (H, W) uint8, whose slopes are nearest to slopes (H, W, 2), to "
          "the right and down, by the squares; pixel, m per pixel. At the image's edge a height is free. A slope that "
          "is not finite counts as 0.");
}
