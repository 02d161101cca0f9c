// Memory for large tables that are read all over the place. On huge pages hardly a read waits until the processor has
// looked up where its page lies.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <new>
#include <vector>

template <class T>
struct HugePages {
    using value_type = T;

    HugePages() = default;
    template <class U>
    HugePages(const HugePages<U>&) {}

    T* allocate(std::size_t count) {
        constexpr std::size_t kPage = std::size_t{2} << 20, kLine = 64;
        std::size_t bytes = count * sizeof(T);
        const std::size_t unit = bytes < kPage / 2 ? kLine : kPage;  // less than half a page is not worth one
        bytes = (bytes + unit - 1) / unit * unit;
        void* out = std::aligned_alloc(unit, bytes);
        if (!out) throw std::bad_alloc();
        if (unit == kPage) madvise(out, bytes, MADV_HUGEPAGE);  // a kernel without them says no, and all works as well
        return static_cast<T*>(out);
    }

    void deallocate(T* memory, std::size_t) { std::free(memory); }

    template <class U>
    bool operator==(const HugePages<U>&) const {
        return true;
    }
    template <class U>
    bool operator!=(const HugePages<U>&) const {
        return false;
    }
};

template <class T>
using Table = std::vector<T, HugePages<T>>;
