// Features of the core that are compiled in: all, unless PRIMRAY_WITHOUT (CMakeLists.txt) leaves some out, to measure the cost
// of their code in scenes that do not use them (tests/bench/features_off.py). A scene that needs a feature left out is refused.
#pragma once

// CMakeLists.txt defines those that are left out as 0.
#ifndef PRIMRAY_HAS_ATTRIBUTES
#define PRIMRAY_HAS_ATTRIBUTES 1
#endif
#ifndef PRIMRAY_HAS_CURVES
#define PRIMRAY_HAS_CURVES 1
#endif
#ifndef PRIMRAY_HAS_CUTOUTS
#define PRIMRAY_HAS_CUTOUTS 1
#endif
#ifndef PRIMRAY_HAS_EMISSION
#define PRIMRAY_HAS_EMISSION 1
#endif
#ifndef PRIMRAY_HAS_INSTANCES
#define PRIMRAY_HAS_INSTANCES 1
#endif
#ifndef PRIMRAY_HAS_LIGHT_IMAGES
#define PRIMRAY_HAS_LIGHT_IMAGES 1
#endif
#ifndef PRIMRAY_HAS_LINKS
#define PRIMRAY_HAS_LINKS 1
#endif
#ifndef PRIMRAY_HAS_LOBE_FACTORS
#define PRIMRAY_HAS_LOBE_FACTORS 1
#endif
#ifndef PRIMRAY_HAS_MOTION
#define PRIMRAY_HAS_MOTION 1
#endif
#ifndef PRIMRAY_HAS_PORTALS
#define PRIMRAY_HAS_PORTALS 1
#endif
#ifndef PRIMRAY_HAS_SHAPING
#define PRIMRAY_HAS_SHAPING 1
#endif
#ifndef PRIMRAY_HAS_SPECIAL_SHADOWS
#define PRIMRAY_HAS_SPECIAL_SHADOWS 1
#endif
#ifndef PRIMRAY_HAS_SPHERES
#define PRIMRAY_HAS_SPHERES 1
#endif
#ifndef PRIMRAY_HAS_TEXTURES
#define PRIMRAY_HAS_TEXTURES 1
#endif
#ifndef PRIMRAY_HAS_THIN
#define PRIMRAY_HAS_THIN 1
#endif

namespace primray {

namespace built {
constexpr bool kAttributes = PRIMRAY_HAS_ATTRIBUTES;
constexpr bool kCurves = PRIMRAY_HAS_CURVES;
constexpr bool kCutouts = PRIMRAY_HAS_CUTOUTS;
constexpr bool kEmission = PRIMRAY_HAS_EMISSION;
constexpr bool kInstances = PRIMRAY_HAS_INSTANCES;
constexpr bool kLightImages = PRIMRAY_HAS_LIGHT_IMAGES;
constexpr bool kLinks = PRIMRAY_HAS_LINKS;
constexpr bool kLobeFactors = PRIMRAY_HAS_LOBE_FACTORS;
constexpr bool kMotion = PRIMRAY_HAS_MOTION;
constexpr bool kPortals = PRIMRAY_HAS_PORTALS;
constexpr bool kShaping = PRIMRAY_HAS_SHAPING;
constexpr bool kSpecialShadows = PRIMRAY_HAS_SPECIAL_SHADOWS;
constexpr bool kSpheres = PRIMRAY_HAS_SPHERES;
constexpr bool kTextures = PRIMRAY_HAS_TEXTURES;
constexpr bool kThin = PRIMRAY_HAS_THIN;
}  // namespace built

// Whether a scene uses a feature: what is false saves work, and it is always false in a build without the feature.
template <bool kBuilt>
class Fact {
 public:
  constexpr Fact(bool value) : value_(value) {}
  constexpr operator bool() const { return kBuilt && value_; }
  Fact& operator|=(bool value) { return value_ |= value, *this; }
  // Whether the scene needs what this build lacks.
  bool is_left_out() const { return !kBuilt && value_; }

 private:
  bool value_;
};

}  // namespace primray
