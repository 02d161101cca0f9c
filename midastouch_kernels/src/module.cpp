// The Python module: every file of kernels adds its own.
#include "arrays.hpp"
#include "parallel.hpp"

#include <sched.h>

#include <stdexcept>

void bind_alignment(nb::module_&);
void bind_canvas(nb::module_&);
void bind_colour_table(nb::module_&);
void bind_farthest_points(nb::module_&);
void bind_image(nb::module_&);
void bind_integration(nb::module_&);
void bind_measurement(nb::module_&);
void bind_motion(nb::module_&);
void bind_pose_cells(nb::module_&);
void bind_pose_graph(nb::module_&);
void bind_renderer(nb::module_&);
void bind_resampling(nb::module_&);
void bind_shading(nb::module_&);
void bind_surface(nb::module_&);
void bind_tangent(nb::module_&);
void bind_triangle_grid(nb::module_&);
void bind_voxels(nb::module_&);

namespace {

int available() {
    cpu_set_t set;
    return sched_getaffinity(0, sizeof(set), &set) == 0 ? CPU_COUNT(&set) : 1;
}

int threads = 0;  // 0: one per available core

}  // namespace

int thread_count() {
    return threads ? threads : available();
}

void set_thread_count(int count) {
    if (count < 0) throw std::invalid_argument("a negative number of threads");
    threads = count;
}

NB_MODULE(MODULE_NAME, m) {
    nb::set_leak_warnings(false);  // what a cache still holds when Python ends is no leak
    m.def("set_threads", &set_thread_count, nb::arg("count"),
          "Threads that kernels over batches start; 0: one per available core.");
    bind_alignment(m);
    bind_canvas(m);
    bind_colour_table(m);
    bind_farthest_points(m);
    bind_image(m);
    bind_integration(m);
    bind_measurement(m);
    bind_motion(m);
    bind_pose_cells(m);
    bind_pose_graph(m);
    bind_renderer(m);
    bind_resampling(m);
    bind_shading(m);
    bind_surface(m);
    bind_tangent(m);
    bind_triangle_grid(m);
    bind_voxels(m);
}
