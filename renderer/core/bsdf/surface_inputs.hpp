// Sources of a surface's varying inputs, as data. evaluate_inputs.hpp evaluates them in lanes.
#pragma once

#include <vector>

#include "bsdf/surface.hpp"
#include "texture/lookup.hpp"

namespace primray {

// Source of one input: a primvar, a texture at the st of a primvar, or an output of the surface's tape.
struct InputSource {
  InputField field = InputField::kDiffuseColor;
  int primvar = -1;        // name of the value, or of a texture's st; -1: always `fallback`
  int tangents = -1;       // for normal maps: name of the st that spans the tangents
  float fallback[3] = {};  // used if the shape has no such primvar
  int texture = -1;        // index into Scene::textures, or -1
  Wrap wrap_s = Wrap::kBlack, wrap_t = Wrap::kBlack;
  float st_transform[6] = {1, 0, 0, 0, 1, 0};       // 2 x 3, by rows
  float scale[3] = {1, 1, 1}, bias[3] = {0, 0, 0};  // for the channels that are read
  float missing[3] = {};                            // value where a UDIM set has no tile
  int output = -1;                                  // output of the surface's tape, or -1; `fallback` then has its estimated
                                                    // mean
};

// Inputs of a surface: those in `sources` vary, `constants` has the others.
struct SurfaceInputs {
  SurfaceInput constants;
  std::vector<InputSource> sources;
  int tape = -1;  // index into Scene::tapes, or -1

  const InputSource* find(InputField field) const {
    for (const InputSource& s : sources)
      if (s.field == field) return &s;
    return nullptr;
  }
};

}  // namespace primray
