// Eight single-precision numbers at a time, in GCC's and Clang's vector types: every processor runs them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

inline constexpr int kLanes = 8;
typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float))));
typedef int32_t Mask __attribute__((vector_size(kLanes * sizeof(int32_t))));

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

inline void store(float* p, Lanes x) {
    std::memcpy(p, &x, sizeof(x));
}

inline Lanes all(float value) {
    return Lanes{} + value;
}

inline Lanes magnitude(Lanes x) {
    return x < 0 ? -x : x;
}

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
