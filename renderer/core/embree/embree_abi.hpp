// The part of Embree 4.4's C interface that is used, declared here because the embreex wheel contains the library alone.
//
// Names, values and layouts follow Embree's public headers, include/embree4/rtcore_*.h, v4.4.0 (Apache-2.0), as built into the
// wheel: one instance level, instance arrays, no minimum curve width. embree.cpp checks the version when it loads it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace primray::rtc {

struct DeviceHandle;
struct SceneHandle;
struct GeometryHandle;
struct BvhHandle;
using Device = DeviceHandle*;
using Scene = SceneHandle*;
using Geometry = GeometryHandle*;
using Bvh = BvhHandle*;

constexpr uint32_t kInvalidId = 0xffffffffu;

enum GeometryType : int { kTriangle = 0, kQuad = 1, kRoundBezierCurve = 24, kUser = 120, kInstanceArray = 122 };
enum BufferType : int { kIndexBuffer = 0, kVertexBuffer = 1, kTransformBuffer = 23 };
enum Format : int {
  kUint = 0x5001,
  kUint3 = 0x5003,
  kUint4 = 0x5004,
  kFloat3 = 0x9003,
  kFloat4 = 0x9004,
  kFloat3x4ColumnMajor = 0x9234,
  kQuaternionDecomposition = 0xb001
};
enum SceneFlags : int { kCompact = 1 << 1, kRobust = 1 << 2 };
enum BuildQuality : int { kMediumQuality = 1 };
enum DeviceProperty : int { kVersion = 0 };

// RTCRay and RTCHit for N rays; N = 1 is the single ray.
template <int N>
struct alignas(N * 4 < 16 ? 16 : N * 4) Ray {
  float org_x[N], org_y[N], org_z[N], tnear[N];
  float dir_x[N], dir_y[N], dir_z[N], time[N];
  float tfar[N];
  uint32_t mask[N], id[N], flags[N];
};
template <int N>
struct alignas(N * 4 < 16 ? 16 : N * 4) Hit {
  float ng_x[N], ng_y[N], ng_z[N], u[N], v[N];
  uint32_t prim_id[N], geom_id[N], inst_id[N], inst_prim_id[N];
};
template <int N>
struct RayHit {
  Ray<N> ray;
  Hit<N> hit;
};
static_assert(sizeof(Ray<1>) == 48 && sizeof(Hit<1>) == 48 && sizeof(Ray<16>) == 768 && sizeof(Hit<16>) == 576);

struct alignas(16) Bounds {
  float lower_x, lower_y, lower_z, align0;
  float upper_x, upper_y, upper_z, align1;
};
struct RayQueryContext {
  uint32_t inst_id, inst_prim_id;
};
struct BoundsArguments {
  void* user;
  uint32_t prim_id, time_step;
  Bounds* bounds;
};
struct IntersectArguments {
  int* valid;
  void* user;
  uint32_t prim_id;
  RayQueryContext* context;
  float* rayhit;  // Ray<N>, then Hit<N>
  uint32_t n, geom_id;
};
struct OccludedArguments {
  int* valid;
  void* user;
  uint32_t prim_id;
  RayQueryContext* context;
  float* ray;  // Ray<N>
  uint32_t n, geom_id;
};
// RTCFilterFunctionNArguments; valid[i] is -1 for the hits to test, and is set to 0 to reject one.
struct FilterArguments {
  int* valid;
  void* user;
  RayQueryContext* context;
  float* ray;  // Ray<N>
  float* hit;  // Hit<N>
  uint32_t n;
};
struct QueryArguments {
  int flags = 0;  // incoherent: the coherent flag picks other winners at ties
  uint32_t feature_mask = 0xffffffffu;
  RayQueryContext* context = nullptr;
  void* filter = nullptr;
  void* callback = nullptr;
};

// RTCBuildPrimitive and RTCBuildArguments: custom hierarchies by Embree's builder.
struct alignas(32) BuildPrimitive {
  float lower_x, lower_y, lower_z;
  uint32_t geom_id;
  float upper_x, upper_y, upper_z;
  uint32_t prim_id;
};
struct BuildArguments {
  size_t byte_size = sizeof(BuildArguments);
  int quality = kMediumQuality, flags = 0;
  uint32_t branching = 2, max_depth = 32, block = 1, min_leaf = 1, max_leaf = 32;
  float traversal_cost = 1, intersection_cost = 1;
  Bvh bvh = nullptr;
  BuildPrimitive* primitives = nullptr;
  size_t count = 0, capacity = 0;
  void* (*create_node)(void* allocator, unsigned children, void* user) = nullptr;
  void (*set_children)(void* node, void** children, unsigned count, void* user) = nullptr;
  void (*set_bounds)(void* node, const Bounds** bounds, unsigned count, void* user) = nullptr;
  void* (*create_leaf)(void* allocator, const BuildPrimitive*, size_t count, void* user) = nullptr;
  void *split = nullptr, *progress = nullptr, *user = nullptr;
};

using MemoryMonitor = bool (*)(void* user, ptrdiff_t bytes, bool post);
using BoundsFunction = void (*)(const BoundsArguments*);
using IntersectFunction = void (*)(const IntersectArguments*);
using OccludedFunction = void (*)(const OccludedArguments*);
using FilterFunction = void (*)(const FilterArguments*);

// Entry points, filled by load_embree().
struct Api {
  Device (*rtcNewDevice)(const char*);
  int (*rtcGetDeviceError)(Device);
  void (*rtcSetDeviceMemoryMonitorFunction)(Device, MemoryMonitor, void*);
  ptrdiff_t (*rtcGetDeviceProperty)(Device, int);
  Scene (*rtcNewScene)(Device);
  void (*rtcReleaseScene)(Scene);
  void (*rtcSetSceneFlags)(Scene, int);
  void (*rtcSetSceneBuildQuality)(Scene, int);
  void (*rtcCommitScene)(Scene);
  void (*rtcGetSceneBounds)(Scene, Bounds*);
  Geometry (*rtcNewGeometry)(Device, int);
  void (*rtcReleaseGeometry)(Geometry);
  void (*rtcCommitGeometry)(Geometry);
  void (*rtcAttachGeometryByID)(Scene, Geometry, uint32_t);
  void (*rtcSetSharedGeometryBuffer)(Geometry, int, uint32_t, int, const void*, size_t, size_t, size_t);
  void (*rtcSetGeometryInstancedScene)(Geometry, Scene);
  void (*rtcSetGeometryUserPrimitiveCount)(Geometry, uint32_t);
  void (*rtcSetGeometryTimeStepCount)(Geometry, uint32_t);
  void (*rtcSetGeometryUserData)(Geometry, void*);
  void (*rtcSetGeometryBoundsFunction)(Geometry, BoundsFunction, void*);
  void (*rtcSetGeometryIntersectFunction)(Geometry, IntersectFunction);
  void (*rtcSetGeometryOccludedFunction)(Geometry, OccludedFunction);
  void (*rtcSetGeometryIntersectFilterFunction)(Geometry, FilterFunction);
  void (*rtcSetGeometryOccludedFilterFunction)(Geometry, FilterFunction);
  Bvh (*rtcNewBVH)(Device);
  void (*rtcReleaseBVH)(Bvh);
  void* (*rtcBuildBVH)(const BuildArguments*);
  void (*rtcIntersect1)(Scene, RayHit<1>*, QueryArguments*);
  void (*rtcIntersect4)(const int*, Scene, RayHit<4>*, QueryArguments*);
  void (*rtcIntersect8)(const int*, Scene, RayHit<8>*, QueryArguments*);
  void (*rtcIntersect16)(const int*, Scene, RayHit<16>*, QueryArguments*);
  void (*rtcOccluded1)(Scene, Ray<1>*, QueryArguments*);
  void (*rtcOccluded4)(const int*, Scene, Ray<4>*, QueryArguments*);
  void (*rtcOccluded8)(const int*, Scene, Ray<8>*, QueryArguments*);
  void (*rtcOccluded16)(const int*, Scene, Ray<16>*, QueryArguments*);
};

}  // namespace primray::rtc
