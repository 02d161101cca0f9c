// A triangle soup in a uniform grid: which triangles may lie in which cell.
#pragma once

#include "arrays.hpp"
#include "huge_pages.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

class TriangleGrid {
public:
    // What tells in single precision that a triangle is out of reach or sight: a ball around it, and its unit normal.
    struct Ball {
        float x, y, z, radius;
        float nx, ny, nz;
    };

    TriangleGrid(In<double, -1, 3, 3> corners, double cell);

    std::size_t faces() const { return balls_.size(); }
    const double* corners(int32_t face) const { return corners_.data() + 9 * static_cast<std::size_t>(face); }
    const Ball& ball(int32_t face) const { return balls_[face]; }

    double cell() const { return cell_; }
    // Where the cells of index i along axis k begin.
    double edge(int k, int64_t i) const { return origin_[k] + static_cast<double>(i) * cell_; }
    // First and last index along axis k of the cells that meet [low, high]: none, if that lies outside the grid.
    int64_t first(int k, double low) const {
        const double i = std::floor((low - origin_[k]) / cell_);
        return i > 0 ? static_cast<int64_t>(std::min(i, static_cast<double>(shape_[k]))) : 0;
    }
    int64_t last(int k, double high) const {
        const double i = std::floor((high - origin_[k]) / cell_);
        return i >= 0 ? static_cast<int64_t>(std::min(i, static_cast<double>(shape_[k] - 1))) : -1;
    }

    struct Cell {
        const int32_t *first, *last;
        const int32_t* begin() const { return first; }
        const int32_t* end() const { return last; }
        bool empty() const { return first == last; }
    };
    // Triangles whose bounding box meets the cell.
    Cell faces_in(int64_t x, int64_t y, int64_t z) const {
        const int64_t c = (x * shape_[1] + y) * shape_[2] + z;
        return {items_.data() + start_[c], items_.data() + start_[c + 1]};
    }

private:
    Table<double> corners_;  // (F, 3, 3)
    Table<Ball> balls_;
    Table<int64_t> start_;  // triangles of cell c: items_[start_[c]] up to items_[start_[c + 1]]
    Table<int32_t> items_;
    double origin_[3], cell_;
    int64_t shape_[3];
};
