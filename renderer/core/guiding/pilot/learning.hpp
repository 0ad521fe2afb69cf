// Results of learning before a render: the guide, the guide for caustics, and the number of paths and light samples at the
// first surface.
#pragma once

#include <atomic>
#include <memory>

#include "guiding/caustic_guide.hpp"
#include "guiding/guide.hpp"
#include "render/task_function.hpp"

namespace primray {

// Guide for caustics, learnt from photons before the render.

// Returns the guide, or null if there are no significant caustics. A function of scene and depth alone, not of seed, threads or
// lanes, so that every part of a distributed render has the same one.
//
// `cancel`, here and in IntegratorSettings: once it is true, learning ends soon and its result is not to be used.
std::unique_ptr<CausticGuide> find_caustics(const Scene& scene, int max_depth, int threads,
                                            const std::atomic<bool>* cancel = nullptr);

// Returns the guide, or null if it would not pay.
std::unique_ptr<CausticGuide> learn_caustics(const Scene& scene, int max_depth, int threads, TaskFunction task,
                                             const std::atomic<bool>* cancel = nullptr);

// Number of paths and light samples at the first surface, measured on a few pixels before the render.

// Paths that continue from the first surface (1, 2, 4 or 8), and light samples taken there (1, 2 or 4).
struct Splits {
  int paths = 1, lights = 1;
};

// Chooses by error per ray. A function of scene, depth and guide, not of seed, samples, threads or lanes, so that every part of
// a distributed render makes the same choice.
Splits choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task);

// Returns the guide, or null if it would not pay. A function of scene (with the size of its frame, as more is learnt for a
// picture that takes longer), depth and settings.splits alone (0: as choose_splits() chooses), not of seed, threads or lanes,
// so that every part of a distributed render has the same one.
std::unique_ptr<Guide> learn_guide(const Scene& scene, const IntegratorSettings& settings, TaskFunction task);

}  // namespace primray
