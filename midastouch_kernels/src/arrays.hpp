// Types of the arrays that kernels take and give, and how their arguments are named.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <memory>
#include <new>

namespace nb = nanobind;

template <class T, nb::ssize_t... Sizes>
using In = nb::ndarray<const T, nb::shape<Sizes...>, nb::c_contig, nb::device::cpu>;

template <class T, nb::ssize_t... Sizes>
using InOut = nb::ndarray<T, nb::shape<Sizes...>, nb::c_contig, nb::device::cpu>;

template <class T>
using Out = nb::ndarray<nb::numpy, T>;

// A new array of zeros that Python owns. Pages that nobody writes to cost nothing.
template <class T>
Out<T> make_array(std::initializer_list<std::size_t> shape) {
    std::size_t size = 1;
    for (std::size_t n : shape) size *= n;
    T* data = static_cast<T*>(std::calloc(std::max<std::size_t>(size, 1), sizeof(T)));
    if (!data) throw std::bad_alloc();
    nb::capsule owner(data, [](void* p) noexcept { std::free(p); });
    return Out<T>(data, shape.size(), shape.begin(), owner);
}

// The item, a std::array, at an index of an array of such items.
template <class Item>
Item item_at(const typename Item::value_type* items, std::size_t index) {
    Item out;
    std::copy_n(items + index * out.size(), out.size(), out.begin());
    return out;
}

template <class Item>
void put(const Item& item, typename Item::value_type* items, std::size_t index) {
    std::copy(item.begin(), item.end(), items + index * item.size());
}

// A named argument that is never converted: a converted copy would swallow what a kernel writes.
inline auto named(const char* name) {
    return nb::arg(name).noconvert();
}
