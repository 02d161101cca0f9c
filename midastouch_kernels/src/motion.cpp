// Motion of the particles: odometry, noise, and the maps of modes to where their penetration maps put them.
#include "arrays.hpp"
#include "noise.hpp"
#include "quaternion.hpp"
#include "tangent.hpp"

#include <algorithm>
#include <cmath>

namespace {

// How far (4, 4) is from a rigid transform, its row [x y z qx qy qz qw], and that row as a transform.
nb::tuple decompose(In<double, 4, 4> transform) {
    const double* t = transform.data();
    auto r = [&](int i, int j) { return t[4 * i + j]; };
    double error = std::max({std::abs(t[12]), std::abs(t[13]), std::abs(t[14]), std::abs(t[15] - 1)});
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const double dot = r(0, i) * r(0, j) + r(1, i) * r(1, j) + r(2, i) * r(2, j);
            error = std::max(error, std::abs(dot - (i == j)));
        }
    const double determinant = r(0, 0) * (r(1, 1) * r(2, 2) - r(1, 2) * r(2, 1)) -
                               r(0, 1) * (r(1, 0) * r(2, 2) - r(1, 2) * r(2, 0)) +
                               r(0, 2) * (r(1, 0) * r(2, 1) - r(1, 1) * r(2, 0));
    auto row = make_array<double>({7}), rigid = make_array<double>({4, 4});
    const Quaternion<double> q = from_matrix(t, 4);
    const double values[7] = {r(0, 3), r(1, 3), r(2, 3), q.x, q.y, q.z, q.w};
    std::copy_n(values, 7, row.data());
    to_matrix(q, rigid.data(), 4);
    for (int i = 0; i < 3; ++i) rigid.data()[4 * i + 3] = r(i, 3);
    rigid.data()[15] = 1;
    return nb::make_tuple(determinant > 0 ? error : INFINITY, row, rigid);
}

// Move by `step` [x y z qx qy qz qw]; then each by noise of its own, of widths `scale` (6,), unless `noise` is null.
void compose(std::size_t low, std::size_t high, InOut<float, -1, 3> positions, InOut<float, -1, 4> quaternions,
             In<float, 7> step, In<float, 6> scale, NormalStream* noise) {
    if (low > high || high > positions.shape(0) || high > quaternions.shape(0))
        throw nb::value_error("range beyond the particles");
    nb::gil_scoped_release released;
    const float *s = step.data(), *width = scale.data();
    const Quaternion<float> turn{s[3], s[4], s[5], s[6]};
    for (std::size_t block = low; block < high; block += kLanes) {
        Lanes drawn[6] = {};
        if (noise)
            for (int a = 0; a < 6; a += 2) noise->draw(drawn[a], drawn[a + 1]);
        for (int a = 0; a < 6; ++a) drawn[a] *= width[a];
        for (std::size_t i = block; i < std::min(block + kLanes, high); ++i) {
            const std::size_t l = i - block;
            float *t = positions.data() + 3 * i, *r = quaternions.data() + 4 * i, moved[3];
            Quaternion<float> q{r[0], r[1], r[2], r[3]};
            rotate(q, s[0], s[1], s[2], moved);
            for (int a = 0; a < 3; ++a) t[a] += moved[a];
            q = multiply(q, turn);
            if (noise) {
                rotate(q, drawn[0][l], drawn[1][l], drawn[2][l], moved);
                for (int a = 0; a < 3; ++a) t[a] += moved[a];
                q = multiply(q, Quaternion<float>{drawn[3][l], drawn[4][l], drawn[5][l], 1.0f});
            }
            const float shrink = 1 / std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
            r[0] = q.x * shrink, r[1] = q.y * shrink, r[2] = q.z * shrink, r[3] = q.w * shrink;
        }
    }
}

// Poses around `centres` (C, 4, 4), each around that of its `index`: moved by the exponential of factor (6, 6) times
// normal (N, 6), in the centre's own frame.
void spread(std::size_t low, std::size_t high, In<double, -1, 4, 4> centres, In<int64_t, -1> index,
            In<double, 6, 6> factor, In<double, -1, 6> normal, InOut<float, -1, 3> positions,
            InOut<float, -1, 4> quaternions) {
    if (low > high ||
        high > std::min({index.shape(0), normal.shape(0), positions.shape(0), quaternions.shape(0)}))
        throw nb::value_error("range beyond the poses");
    for (std::size_t i = low; i < high; ++i)
        if (index.data()[i] < 0 || static_cast<std::size_t>(index.data()[i]) >= centres.shape(0))
            throw nb::value_error("a centre that is not there");
    nb::gil_scoped_release released;
    for (std::size_t i = low; i < high; ++i) {
        Transform centre;
        std::copy_n(centres.data() + 16 * index.data()[i], 16, centre.begin());
        Vector6 moved{};
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b < 6; ++b) moved[a] += factor.data()[6 * a + b] * normal.data()[6 * i + b];
        const Transform pose = centre * exponential(moved);
        const Quaternion<double> q = from_matrix(pose.data(), 4);
        float *t = positions.data() + 3 * i, *r = quaternions.data() + 4 * i;
        for (int a = 0; a < 3; ++a) t[a] = static_cast<float>(pose[4 * a + 3]);
        r[0] = static_cast<float>(q.x), r[1] = static_cast<float>(q.y);
        r[2] = static_cast<float>(q.z), r[3] = static_cast<float>(q.w);
    }
}

void map_modes(std::size_t low, std::size_t high, In<int32_t, -1> members, In<int32_t, -1> map_of,
               In<double, -1, 3> position, In<double, -1, 3, 3> rotation, In<double, -1, 4> turn,
               In<double, -1, 3> new_position, In<double, -1, 3, 3> new_rotation, In<double, -1, 4> new_turn,
               In<double, -1, 6, 6> shrink, InOut<float, -1, 3> positions, InOut<float, -1, 4> quaternions) {
    const int32_t maps = static_cast<int32_t>(position.shape(0)), modes = static_cast<int32_t>(map_of.shape(0));
    if (low > high || high > positions.shape(0) || high > quaternions.shape(0) || high > members.shape(0))
        throw nb::value_error("range beyond the particles");
    for (int32_t mode = 0; mode < modes; ++mode)
        if (map_of.data()[mode] >= maps) throw nb::value_error("a map that is not there");
    for (std::size_t i = low; i < high; ++i)
        if (members.data()[i] >= modes) throw nb::value_error("a mode that is not there");
    nb::gil_scoped_release released;
    for (std::size_t i = low; i < high; ++i) {
        const int32_t mode = members.data()[i], k = mode < 0 ? -1 : map_of.data()[mode];
        if (k < 0) continue;
        float *t = positions.data() + 3 * i, *r = quaternions.data() + 4 * i;
        const double *t0 = position.data() + 3 * k, *r0 = rotation.data() + 9 * k, *q0 = turn.data() + 4 * k;
        const double *t1 = new_position.data() + 3 * k, *r1 = new_rotation.data() + 9 * k;
        const double *q1 = new_turn.data() + 4 * k, *linear = shrink.data() + 36 * k;
        double deviation[6], mapped[6];
        for (int a = 0; a < 3; ++a) {
            deviation[a] = 0;
            for (int b = 0; b < 3; ++b) deviation[a] += r0[3 * b + a] * (t[b] - t0[b]);
        }
        rotation_vector(multiply(Quaternion<double>{-q0[0], -q0[1], -q0[2], q0[3]},
                                 Quaternion<double>{r[0], r[1], r[2], r[3]}),
                        deviation + 3);
        for (int a = 0; a < 6; ++a) {  // the map is a lower triangle
            mapped[a] = 0;
            for (int b = 0; b <= a; ++b) mapped[a] += linear[6 * a + b] * deviation[b];
        }
        for (int a = 0; a < 3; ++a) {
            double moved = t1[a];
            for (int b = 0; b < 3; ++b) moved += r1[3 * a + b] * mapped[b];
            t[a] = static_cast<float>(moved);
        }
        const Quaternion<double> q = multiply(Quaternion<double>{q1[0], q1[1], q1[2], q1[3]}, rotation_of(mapped + 3));
        r[0] = static_cast<float>(q.x), r[1] = static_cast<float>(q.y);
        r[2] = static_cast<float>(q.z), r[3] = static_cast<float>(q.w);
    }
}

}  // namespace

void bind_motion(nb::module_& m) {
    m.def("decompose", &decompose, named("transform"),
          "How far a transform (4, 4) is from a rigid one, its row [x y z qx qy qz qw], and that row as a transform.");
    nb::class_<NormalStream>(m, "NormalStream", "Normal random numbers; equal seeds give equal ones.")
        .def(nb::init<uint64_t>(), nb::arg("seed"));
    m.def("compose", &compose, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"),
          named("step"), named("scale"), nb::arg("noise").none(),
          "Move poses [low, high) by a step (7,), then each by noise of widths `scale` (6,), unless that is None.");
    m.def("spread", &spread, nb::arg("low"), nb::arg("high"), named("centres"), named("index"), named("factor"),
          named("normal"), named("positions"), named("quaternions"),
          "Set poses [low, high) around centres (C, 4, 4), those of `index` (N,): moved by the exponential of factor "
          "(6, 6) times normal (N, 6), own frame.");
    m.def("map_modes", &map_modes, nb::arg("low"), nb::arg("high"), named("members"), named("map_of"),
          named("position"), named("rotation"), named("turn"), named("new_position"), named("new_rotation"), named("new_turn"),
          named("shrink"), named("positions"), named("quaternions"),
          "Apply map `map_of` (m,) of one Gaussian to another, that of its mode `members` (N,), to each pose of a range; "
          "-1: none.");
}
