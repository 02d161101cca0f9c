// A loop over threads, for batches that are worth starting some.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

int thread_count();
void set_thread_count(int count);

// Calls body(first, last) on pieces of at most `piece` items that cover [0, n), on several threads. If one throws, no
// further piece begins, and the exception reaches the caller.
template <class Body>
void parallel_for(std::size_t n, std::size_t piece, Body&& body) {
    const std::size_t pieces = (n + piece - 1) / piece;
    const std::size_t threads = std::min<std::size_t>(thread_count(), pieces);
    if (threads < 2) {
        body(std::size_t{0}, n);
        return;
    }
    std::atomic<std::size_t> next{0};
    std::exception_ptr failure;
    std::mutex failing;
    auto work = [&] {
        try {
            for (std::size_t k; (k = next.fetch_add(1)) < pieces;) body(k * piece, std::min(n, (k + 1) * piece));
        } catch (...) {  // beyond a thread's own function it would end the process
            const std::lock_guard<std::mutex> guard(failing);
            failure = std::current_exception();
            next = pieces;
        }
    };
    std::vector<std::thread> helpers;
    try {
        for (std::size_t k = 1; k < threads; ++k) helpers.emplace_back(work);
    } catch (const std::system_error&) {
        // a container may allow no more: fewer do it, too
    }
    work();
    for (std::thread& helper : helpers) helper.join();
    if (failure) std::rethrow_exception(failure);
}
