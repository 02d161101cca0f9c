// Metallic-roughness shading (glTF 2.0, appendix B) with spot lights that point at the optical axis. Pixels are worked
// on by the block, quantity after quantity, which the compiler turns into vector instructions.
#include "arrays.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace {

constexpr float kPi = 3.14159265f;
constexpr float kGamma = 1 / 2.2f;
constexpr int kBlock = 64;

inline float clamp(float x, float low, float high) {
    x = x > low ? x : low;
    return x < high ? x : high;
}

// x to the power of gamma for x in [0, 1], to 2e-6 of the value (the cases of std::pow keep a loop from being
// vectorised).
inline float gamma(float x) {
    // logarithm: x = m 2^e with m in [sqrt(1/2), sqrt(2)), ln m as a series of the odd powers of (m - 1) / (m + 1)
    x = x > 1e-30f ? x : 1e-30f;
    int32_t bits;
    std::memcpy(&bits, &x, sizeof(bits));
    const int32_t exponent = (bits - 0x3f3504f3) >> 23;
    bits -= exponent << 23;
    float m;
    std::memcpy(&m, &bits, sizeof(m));
    const float t = (m - 1) / (m + 1), t2 = t * t;
    const float log2 = exponent + 2.88539008f * t * (1 + t2 * (1 / 3.0f + t2 * (1 / 5.0f + t2 * (1 / 7.0f + t2 / 9))));
    // exponential: 2^y = 2^n 2^r with r in [-1/2, 1/2]
    const float y = kGamma * log2;
    const int32_t n = static_cast<int32_t>(y - 0.5f);  // y <= 0: towards zero rounds to the nearest
    const float r = (y - n) * 0.693147181f;
    const float power = 1 + r * (1 + r * (1 / 2.0f + r * (1 / 6.0f + r * (1 / 24.0f + r * (1 / 120.0f + r / 720)))));
    const int32_t scale_bits = (n + 127) << 23;
    float scale;
    std::memcpy(&scale, &scale_bits, sizeof(scale));
    return power * scale;
}

struct Light {
    float x, y, z, red, green, blue;
};

struct Material {
    float cone, diffuse, f0, roughness;
};

// What all lights share at a block's pixels.
struct Block {
    float x[kBlock], y[kBlock], z[kBlock];     // m, camera frame
    float nx[kBlock], ny[kBlock], nz[kBlock];  // normal
    float vx[kBlock], vy[kBlock], vz[kBlock];  // towards the camera
    float nv[kBlock];
    float red[kBlock], green[kBlock], blue[kBlock];
};

void add_light(Block& b, int n, const Light& light, const Material& material) {
    const float kk = (material.roughness + 1) * (material.roughness + 1) / 8;
    const float a2 = material.roughness * material.roughness * material.roughness * material.roughness;
    const float from_axis = 1 / std::max(std::sqrt(light.x * light.x + light.y * light.y), 1e-9f);
    const float f0 = material.f0, cone = material.cone, diffuse = material.diffuse;
    for (int i = 0; i < n; ++i) {
        float lx = light.x - b.x[i], ly = light.y - b.y[i], lz = light.z - b.z[i];
        const float squared = lx * lx + ly * ly + lz * lz, inverse = 1 / std::sqrt(squared);
        lx *= inverse, ly *= inverse, lz *= inverse;
        // spot axis: from the light towards the optical axis, parallel to the gel plane
        const float towards = (lx * light.x + ly * light.y) * from_axis, spot = clamp(2 * towards - 1, 0, 1);
        const float strength = (1 - cone + cone * spot * spot) / squared;
        const float hx = lx + b.vx[i], hy = ly + b.vy[i], hz = lz + b.vz[i];
        const float half = 1 / std::sqrt(hx * hx + hy * hy + hz * hz);
        const float nv = b.nv[i], nl = clamp(b.nx[i] * lx + b.ny[i] * ly + b.nz[i] * lz, 1e-3f, 1);
        const float nh = clamp((b.nx[i] * hx + b.ny[i] * hy + b.nz[i] * hz) * half, 0, 1);
        const float vh = clamp((b.vx[i] * hx + b.vy[i] * hy + b.vz[i] * hz) * half, 0, 1);
        const float grazing = 1 - vh, grazing2 = grazing * grazing;
        const float fresnel = f0 + (1 - f0) * grazing2 * grazing2 * grazing;
        const float shadowing = nl * nv / ((nl * (1 - kk) + kk) * (nv * (1 - kk) + kk));
        const float lobe = nh * nh * (a2 - 1) + 1;
        const float microfacets = a2 / (kPi * lobe * lobe);
        const float reflected = (1 - fresnel) * diffuse + fresnel * shadowing * microfacets / (4 * nl * nv + 1e-3f);
        const float energy = strength * nl * reflected;
        b.red[i] += energy * light.red, b.green[i] += energy * light.green, b.blue[i] += energy * light.blue;
    }
}

void prepare(Block& b, int n, const float* depth, const float* normals, const float* tangent_x,
             const float* tangent_y) {
    for (int i = 0; i < n; ++i) b.nx[i] = normals[3 * i], b.ny[i] = normals[3 * i + 1], b.nz[i] = normals[3 * i + 2];
    for (int i = 0; i < n; ++i) {
        const float x = tangent_x[i] * depth[i], y = tangent_y[i] * depth[i], z = -depth[i];
        const float view = -1 / std::sqrt(x * x + y * y + z * z), vx = x * view, vy = y * view, vz = z * view;
        b.x[i] = x, b.y[i] = y, b.z[i] = z;
        b.vx[i] = vx, b.vy[i] = vy, b.vz[i] = vz;
        b.nv[i] = clamp(std::abs(b.nx[i] * vx + b.ny[i] * vy + b.nz[i] * vz), 1e-3f, 1);
        b.red[i] = b.green[i] = b.blue[i] = 0;
    }
}

void to_grey_levels(float* energy, int n) {
    for (int i = 0; i < n; ++i) energy[i] = 255 * gamma(energy[i] < 1 ? energy[i] : 1);
}

Out<float> shade(In<float, -1, -1> depth, In<float, -1, -1, 3> normals, In<float, -1, -1> tangent_x,
                 In<float, -1, -1> tangent_y, In<float, -1, 3> positions, In<float, -1, 3> colours, float cone,
                 float diffuse, float f0, float roughness) {
    const std::size_t height = depth.shape(0), width = depth.shape(1), pixels = height * width;
    for (auto shape : {std::pair(normals.shape(0), normals.shape(1)), std::pair(tangent_x.shape(0), tangent_x.shape(1)),
                       std::pair(tangent_y.shape(0), tangent_y.shape(1))})
        if (shape != std::pair(height, width)) throw nb::value_error("depth, normals and tangents of different sizes");
    if (colours.shape(0) != positions.shape(0)) throw nb::value_error("a colour is needed for each light's position");
    auto out = make_array<float>({height, width, 3});
    nb::gil_scoped_release released;
    const Material material{cone, diffuse, f0, roughness};
    Block block;
    for (std::size_t first = 0; first < pixels; first += kBlock) {
        const int n = static_cast<int>(std::min<std::size_t>(kBlock, pixels - first));
        prepare(block, n, depth.data() + first, normals.data() + 3 * first, tangent_x.data() + first,
                tangent_y.data() + first);
        for (std::size_t k = 0; k < positions.shape(0); ++k) {
            const float *p = positions.data() + 3 * k, *c = colours.data() + 3 * k;
            add_light(block, n, {p[0], p[1], p[2], c[0], c[1], c[2]}, material);
        }
        to_grey_levels(block.red, n), to_grey_levels(block.green, n), to_grey_levels(block.blue, n);
        float* to = out.data() + 3 * first;
        for (int i = 0; i < n; ++i)
            to[3 * i] = block.red[i], to[3 * i + 1] = block.green[i], to[3 * i + 2] = block.blue[i];
    }
    return out;
}

}  // namespace

void bind_shading(nb::module_& m) {
    m.def("shade", &shade, named("depth"), named("normals"), named("tangent_x"), named("tangent_y"), named("positions"),
          named("colours"), nb::arg("cone"), nb::arg("diffuse"), nb::arg("f0"), nb::arg("roughness"),
          "Grey levels (H, W, 3) of a surface of depth (H, W) [m] and normals (H, W, 3), lit from positions (L, 3) [m] "
          "in linear colours (L, 3).");
}
