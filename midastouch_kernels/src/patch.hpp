// The triangles that a pose sees and those near it, drawn from poses close by: for those who look again and again while
// they move a little. Single precision, relative to that place; eight triangles at a time.
#pragma once

#include "lanes.hpp"
#include "renderer.hpp"
#include "tangent.hpp"

#include <cmath>
#include <vector>

class Patch {
public:
    explicit Patch(const Scene& scene);

    // Gather triangles anew at the next pose, so that nothing drawn depends on what was drawn before.
    void restart() { centre_[0] = NAN; }

    // Draw the pose into `penetration` (H, W), padded by a whole load, as `Scene::draw` does but for rounding.
    void draw(const Transform& pose, float* penetration);

private:
    struct Triangles {  // eight of them: coordinate of corner k along the object's axis a in [k][a]
        Lanes corner[3][3];
        std::size_t count;
        int32_t face[kLanes];
    };
    struct Outlines;

    bool covers(const Transform& pose) const;
    void gather(const Transform& pose);
    void fill(const Outlines& outlines, std::size_t which, float* penetration) const;

    const Scene& scene_;
    std::vector<float> gel_depth_;
    Transform centre_{NAN};  // where triangles were gathered, and what their corners are relative to; at first no pose
    std::vector<Triangles> triangles_;
};
