// Inputs of a surface that vary over it: what each reads, as data. evaluate_inputs.hpp runs them on lanes.
#pragma once

#include <vector>

#include "bsdf/surface.hpp"
#include "texture/lookup.hpp"

namespace primray {

// A primvar's value, a texture's at the st that a primvar gives, or an output of the surface's tape.
struct InputSource {
  InputField field = InputField::kDiffuseColor;
  int primvar = -1;        // name of the value, or of a texture's st; -1: always `fallback`
  int tangents = -1;       // of a normal: name of the st that spans its tangents
  float fallback[3] = {};  // where the shape has no such primvar
  int texture = -1;        // index into Scene::textures, or -1
  Wrap wrap_s = Wrap::kBlack, wrap_t = Wrap::kBlack;
  float st_transform[6] = {1, 0, 0, 0, 1, 0};       // 2 x 3, by rows
  float scale[3] = {1, 1, 1}, bias[3] = {0, 0, 0};  // of the channels that are read
  float missing[3] = {};                            // where a set of tiles has none
  int output = -1;                                  // of the surface's tape, or -1; `fallback` has what is known of its mean
};

// A surface's inputs: those in `sources` vary, `constants` has the others.
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
