// List of the light types. A new one is a file beside these, whose struct is one line here.
#pragma once

#include "light/types/cylinder.hpp"
#include "light/types/disk.hpp"
#include "light/types/distant.hpp"
#include "light/types/dome_light.hpp"
#include "light/types/line.hpp"
#include "light/types/mesh.hpp"
#include "light/types/point.hpp"
#include "light/types/rect.hpp"
#include "light/types/sphere.hpp"
#include "light/types/volume.hpp"

namespace primray {

template <class... T>
struct LightTypeList {
  template <class F>
  static PRIMRAY_INLINE void for_each(const F& f) {
    (f(T{}), ...);
  }
  template <class F>
  static PRIMRAY_INLINE void with(LightType type, const F& f) {
    (void)((type == T::kType && (f(T{}), true)) || ...);
  }
};

using LightTypes = LightTypeList<SphereLight, DiskLight, RectLight, CylinderLight, DistantLight, PointLight, LineLight,
                                 DomeLight, MeshLight, VolumeLight>;

template <class T>
concept HittableLightType = requires(LightRow<1> row, vvec3<1> v) { T::hit(row, v, v, v); };

// Calls f(T{}) for each type.
template <class F>
PRIMRAY_INLINE void for_light_types(const F& f) {
  LightTypes::for_each(f);
}
// Calls f for the type of a light's row.
template <class F>
PRIMRAY_INLINE void with_light_type(const float* row, const F& f) {
  LightTypes::with(LightType(int_at(row, kType)), f);
}

// Field of the row that holds its centre.
PRIMRAY_INLINE int light_center(const float* row) {
  int field = kOrigin;
  with_light_type(row, [&]<class T>(T) { field = T::kCenter; });
  return field;
}

// Whether rays can hit lights of that type, other than as geometry or as background.
PRIMRAY_INLINE bool can_be_hit(LightType type) {
  bool found = false;
  LightTypes::with(type, [&]<class T>(T) { found = HittableLightType<T>; });
  return found;
}

}  // namespace primray
