// Normal random numbers, eight streams side by side.
#pragma once

#include "lanes.hpp"

#include <cmath>
#include <cstdint>

// xoshiro128+ (Blackman and Vigna 2021) in each lane, and Box and Muller's transform (1958).
class NormalStream {
public:
    // Equal seeds give equal numbers; the lanes are seeded by SplitMix64, as its authors advise.
    explicit NormalStream(uint64_t seed) {
        for (auto& word : state_)
            for (int l = 0; l < kLanes; ++l) {
                uint64_t z = seed += 0x9e3779b97f4a7c15u;
                z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
                z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
                word[l] = static_cast<uint32_t>((z ^ (z >> 31)) >> 16);
            }
    }

    // Two independent standard normal numbers for each lane; none is farther out than 5.8.
    void draw(Lanes& first, Lanes& second) {
        const Lanes radius = square_root(-2.0f * logarithm(uniform() + 0x1p-24f));
        // a turn in quarters, and what is left of it in [-pi / 4, pi / 4]
        const Lanes quarters = 4.0f * uniform();
        const Mask quarter = __builtin_convertvector(quarters + 0.5f, Mask);
        const Lanes x = (quarters - __builtin_convertvector(quarter, Lanes)) * 1.57079633f, xx = x * x;
        const Lanes sine = ((-1.9515295891e-4f * xx + 8.3321608736e-3f) * xx - 1.6666654611e-1f) * xx * x + x;
        const Lanes cosine =
            ((2.443315711809948e-5f * xx - 1.388731625493765e-3f) * xx + 4.166664568298827e-2f) * xx * xx - 0.5f * xx +
            1.0f;
        const Mask swapped = (quarter & 1) != 0;
        const Lanes s = swapped ? cosine : sine, c = swapped ? sine : cosine;
        first = radius * (((quarter + 1) & 2) != 0 ? -c : c);
        second = radius * ((quarter & 2) != 0 ? -s : s);
    }

private:
    typedef uint32_t Words __attribute__((vector_size(kLanes * sizeof(uint32_t))));

    // In [0, 1), in steps of 2^-24.
    Lanes uniform() {
        const Words out = state_[0] + state_[3], shifted = state_[1] << 9;
        state_[2] ^= state_[0];
        state_[3] ^= state_[1];
        state_[1] ^= state_[2];
        state_[0] ^= state_[3];
        state_[2] ^= shifted;
        state_[3] = (state_[3] << 11) | (state_[3] >> 21);
        const Words high = out >> 8;
        Mask bits;
        std::memcpy(&bits, &high, sizeof(bits));
        return __builtin_convertvector(bits, Lanes) * 0x1p-24f;
    }

    // Natural logarithm of normal numbers > 0, to 1e-7 (the polynomial of Cephes).
    static Lanes logarithm(Lanes x) {
        Mask bits;
        std::memcpy(&bits, &x, sizeof(bits));
        Mask exponent = (bits >> 23) - 126;
        bits = (bits & 0x007fffff) | 0x3f000000;  // in [0.5, 1)
        Lanes m;
        std::memcpy(&m, &bits, sizeof(m));
        const Mask low = m < 0.707106781f;
        exponent += low;  // a true lane is -1
        m = (low ? m + m : m) - 1.0f;
        const Lanes e = __builtin_convertvector(exponent, Lanes), mm = m * m;
        Lanes p = 7.0376836292e-2f * m - 1.1514610310e-1f;
        p = p * m + 1.1676998740e-1f;
        p = p * m - 1.2420140846e-1f;
        p = p * m + 1.4249322787e-1f;
        p = p * m - 1.6668057665e-1f;
        p = p * m + 2.0000714765e-1f;
        p = p * m - 2.4999993993e-1f;
        p = p * m + 3.3333331174e-1f;
        return p * m * mm - 2.12194440e-4f * e - 0.5f * mm + m + 0.693359375f * e;
    }

    static Lanes square_root(Lanes x) {
        for (int l = 0; l < kLanes; ++l) x[l] = std::sqrt(x[l]);
        return x;
    }

    Words state_[4];
};
