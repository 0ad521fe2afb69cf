// Evaluation of displacements: textures, primvars and tapes of materials at the corners of a cage that is being diced.
//
// They are evaluated like shading inputs, in a scene of a few triangles: one for each corner, with that corner first. World
// space is that of the shape's placement if it is placed only once, otherwise the shape's object space.
#pragma once

#include <mutex>
#include <span>
#include <vector>

#include "scene/scene.hpp"
#include "subdivision/dicing/mover.hpp"

namespace primray {

// Order of the names in core/displacement_upload.py.
enum class DisplacedAlong : int32_t { kNothing, kNormal, kTangents, kObjectAxes };

// Primvar of a cage: its interpolation, and where the dicer has it.
struct CagePrimvar {
  enum class Kind { kConstant, kFace, kVertex, kVarying, kFaceVarying };
  int name = 0;
  Kind kind = Kind::kConstant;
  int at = 0;  // column, or index of the face-varying primvar
  int width = 1, row_width = 1;
  std::span<const float> values;  // constant values, and those by face
};

struct DisplacedShape {
  std::span<const int32_t> surfaces;  // one, or one per face; -1: not drawn
  std::vector<CagePrimvar> primvars;
  daffine world_from_object;
};

class Displacer {
 public:
  Displacer();
  // Like SceneBuilder's functions: a surface has the one input that displaces it, or none.
  int add_tape(Tape tape);
  int32_t add_surface(const SurfaceInput& constants, std::vector<InputSource> varying, int tape);
  int add_texture(int channels, bool udim);
  void set_texture_image(int texture, int tile, std::span<const float> pixels, int width, int height);
  void set_primvar_names(int count) { scene_.primvars.names = count; }
  // Sets the directions of displacement, by surface.
  void set_directions(std::vector<DisplacedAlong> along) { along_ = std::move(along); }

  // May be called by several threads.
  void displace(const DisplacedShape& shape, const subdivision::CornerRows& rows, std::span<float> out);

 private:
  void place_triangles(const DisplacedShape& shape, const subdivision::CornerRows& rows);
  void put_primvars(const DisplacedShape& shape, const subdivision::CornerRows& rows);
  void evaluate(const DisplacedShape& shape, const subdivision::CornerRows& rows, std::span<float> out) const;

  Scene scene_;
  std::vector<DisplacedAlong> along_;
  std::mutex one_at_a_time_;
};

}  // namespace primray
