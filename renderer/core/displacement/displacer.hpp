// What displaces a surface, where it is: textures, primvars and tapes of materials at the corners of a cage that is being
// diced.
//
// They are read as surfaces read them when they are shaded, from a scene of a few triangles: one for each corner, with that
// corner first. Its world is where the shape stands if it stands but once, else the shape's own space.
#pragma once

#include <mutex>
#include <span>
#include <vector>

#include "scene/scene.hpp"
#include "subdivision/dicing/mover.hpp"

namespace primray {

// The order of core/dicing/displacement.py's names.
enum class DisplacedAlong : int32_t { kNothing, kNormal, kTangents, kObjectAxes };

// A primvar of a cage: what its rows belong to, and where the dicer has them.
struct CagePrimvar {
  enum class Kind { kConstant, kFace, kVertex, kVarying, kFaceVarying };
  int name = 0;
  Kind kind = Kind::kConstant;
  int at = 0;  // column, or face-varying primvar
  int width = 1, row_width = 1;
  std::span<const float> values;  // constant ones, and those by face
};

struct DisplacedShape {
  std::span<const int32_t> surfaces;  // one, or one a face; -1: what is not drawn
  std::vector<CagePrimvar> primvars;
  daffine world_from_object;
};

class Displacer {
 public:
  Displacer();
  // As SceneBuilder's: a surface has the one input that displaces it, or none.
  int add_tape(Tape tape);
  int32_t add_surface(const SurfaceInput& constants, std::vector<InputSource> varying, int tape);
  int add_texture(int channels, bool udim);
  void set_texture_image(int texture, int tile, std::span<const float> pixels, int width, int height);
  void set_primvar_names(int count) { scene_.primvars.names = count; }
  // By surface.
  void set_directions(std::vector<DisplacedAlong> along) { along_ = std::move(along); }

  // May be called by several threads.
  void displace(const DisplacedShape& shape, const subdivision::CornerRows& rows, std::span<float> out);

 private:
  void stand(const DisplacedShape& shape, const subdivision::CornerRows& rows);
  void put_primvars(const DisplacedShape& shape, const subdivision::CornerRows& rows);
  void evaluate(const DisplacedShape& shape, const subdivision::CornerRows& rows, std::span<float> out) const;

  Scene scene_;
  std::vector<DisplacedAlong> along_;
  std::mutex one_at_a_time_;
};

}  // namespace primray
