// Eight single-precision or four double-precision numbers at a time, in GCC's and Clang's vector types: every processor
// runs them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

inline constexpr int kLanes = 8;
typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float))));
typedef int32_t Mask __attribute__((vector_size(kLanes * sizeof(int32_t))));

inline constexpr std::size_t kQuad = 4;
typedef double Quad __attribute__((vector_size(kQuad * sizeof(double))));

#ifdef __clang__
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, Mask{__VA_ARGS__})
#endif

inline Lanes load(const float* p) {
    Lanes out;
    std::memcpy(&out, p, sizeof(out));
    return out;
}

inline void store(float* p, Lanes x) { std::memcpy(p, &x, sizeof(x)); }

inline Quad load_quad(const double* p) {
    Quad out;
    std::memcpy(&out, p, sizeof(out));
    return out;
}

inline void store_quad(double* p, Quad x) { std::memcpy(p, &x, sizeof(x)); }

inline Lanes all(float value) { return Lanes{} + value; }

inline Lanes magnitude(Lanes x) { return x < 0 ? -x : x; }

inline bool any(Mask mask) {
    int64_t halves[kLanes / 2], bits = 0;
    std::memcpy(halves, &mask, sizeof(mask));
    for (int64_t half : halves) bits |= half;
    return bits != 0;
}

inline double sum(Lanes x) {
    double total = 0;
    for (int l = 0; l < kLanes; ++l) total += x[l];
    return total;
}

// Of each pair of neighbours in a and in b: (a0 + a1, a2 + a3, b0 + b1, b2 + b3, a4 + a5, ...).
inline Lanes add_pairs(Lanes a, Lanes b) {
    return SHUFFLE(a, b, 0, 2, 8, 10, 4, 6, 12, 14) + SHUFFLE(a, b, 1, 3, 9, 11, 5, 7, 13, 15);
}

// e^x for x <= 0, to 2e-7 of its value; 0 below -87; NaN of NaN.
inline Lanes exp_nonpositive(Lanes x) {
    const Mask vanished = x < -87.0f;
    x = vanished ? Lanes{} : x;
    const Mask whole = __builtin_convertvector(x * 1.44269504f - 0.5f, Mask);  // rounded: x is not positive
    const Lanes n = __builtin_convertvector(whole, Lanes);
    // x - n ln 2, ln 2 in two parts (Cody and Waite 1980)
    const Lanes r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
    Lanes p = r * 1.9875691500e-4f + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * r * r + r + 1.0f;
    const Mask bits = (whole + 127) << 23;
    Lanes power;
    std::memcpy(&power, &bits, sizeof(power));
    return vanished ? Lanes{} : p * power;
}
