// Loading of Embree: the library, its entry points, its version, one device for the process.
#include "embree/embree.hpp"

#include <dlfcn.h>

#include <atomic>
#include <limits>
#include <mutex>

#include "base/error.hpp"

namespace primray {
namespace {

// ISA class that this module was compiled for; Embree's own choice by CPU would change bits.
#if defined(__AVX512F__)
constexpr const char* kConfig = "isa=avx512";
#elif defined(__AVX2__)
constexpr const char* kConfig = "isa=avx2";
#else
constexpr const char* kConfig = "isa=sse4.2";
#endif
constexpr ptrdiff_t kWantedVersion = 40400;

rtc::Api api{};
rtc::Device device = nullptr;
std::mutex load_mutex;
std::atomic<int64_t> bytes_now{0}, bytes_peak{0}, bytes_most{std::numeric_limits<int64_t>::max()};

// Called by Embree before it allocates (`post` is false) or after it has. False makes it fail with its out-of-memory error; it
// frees what it had allocated by then.
bool count_memory(void*, ptrdiff_t bytes, bool post) {
  const int64_t now = bytes_now += bytes;
  if (bytes > 0 && !post && now > bytes_most.load()) {
    bytes_now -= bytes;
    return false;
  }
  int64_t peak = bytes_peak.load();
  while (now > peak && !bytes_peak.compare_exchange_weak(peak, now)) {
  }
  return true;
}

template <class F>
void find(void* library, const char* name, F& f) {
  f = reinterpret_cast<F>(dlsym(library, name));
  if (!f) throw Error("embree", std::string("the Embree library has no ") + name);
}

void find_all(void* lib, rtc::Api& a) {
#define PRIMRAY_FIND(name) find(lib, #name, a.name)
  PRIMRAY_FIND(rtcNewDevice);
  PRIMRAY_FIND(rtcGetDeviceError);
  PRIMRAY_FIND(rtcSetDeviceMemoryMonitorFunction);
  PRIMRAY_FIND(rtcGetDeviceProperty);
  PRIMRAY_FIND(rtcNewScene);
  PRIMRAY_FIND(rtcReleaseScene);
  PRIMRAY_FIND(rtcSetSceneFlags);
  PRIMRAY_FIND(rtcSetSceneBuildQuality);
  PRIMRAY_FIND(rtcCommitScene);
  PRIMRAY_FIND(rtcGetSceneBounds);
  PRIMRAY_FIND(rtcNewGeometry);
  PRIMRAY_FIND(rtcReleaseGeometry);
  PRIMRAY_FIND(rtcCommitGeometry);
  PRIMRAY_FIND(rtcAttachGeometryByID);
  PRIMRAY_FIND(rtcSetSharedGeometryBuffer);
  PRIMRAY_FIND(rtcSetGeometryInstancedScene);
  PRIMRAY_FIND(rtcSetGeometryUserPrimitiveCount);
  PRIMRAY_FIND(rtcSetGeometryTimeStepCount);
  PRIMRAY_FIND(rtcSetGeometryUserData);
  PRIMRAY_FIND(rtcSetGeometryBoundsFunction);
  PRIMRAY_FIND(rtcSetGeometryIntersectFunction);
  PRIMRAY_FIND(rtcSetGeometryOccludedFunction);
  PRIMRAY_FIND(rtcSetGeometryIntersectFilterFunction);
  PRIMRAY_FIND(rtcSetGeometryOccludedFilterFunction);
  PRIMRAY_FIND(rtcNewBVH);
  PRIMRAY_FIND(rtcReleaseBVH);
  PRIMRAY_FIND(rtcBuildBVH);
  PRIMRAY_FIND(rtcIntersect1);
  PRIMRAY_FIND(rtcIntersect4);
  PRIMRAY_FIND(rtcIntersect8);
  PRIMRAY_FIND(rtcIntersect16);
  PRIMRAY_FIND(rtcOccluded1);
  PRIMRAY_FIND(rtcOccluded4);
  PRIMRAY_FIND(rtcOccluded8);
  PRIMRAY_FIND(rtcOccluded16);
#undef PRIMRAY_FIND
}

}  // namespace

void load_embree(const std::string& path) {
  const std::lock_guard lock(load_mutex);
  if (device) return;
  void* lib = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!lib) throw Error("embree", std::string("Embree could not be loaded: ") + dlerror());
  rtc::Api found{};
  find_all(lib, found);
  rtc::Device opened = found.rtcNewDevice(kConfig);
  if (!opened) throw Error("embree", std::string("Embree could not create a device with the configuration ") + kConfig);
  const ptrdiff_t version = found.rtcGetDeviceProperty(opened, rtc::kVersion);
  if (version != kWantedVersion) {
    throw Error("embree",
                "Embree " + std::to_string(version) + " was found, but this build needs " + std::to_string(kWantedVersion));
  }
  found.rtcSetDeviceMemoryMonitorFunction(opened, count_memory, nullptr);
  api = found;
  device = opened;
}

const rtc::Api& embree() { return api; }
rtc::Device embree_device() { return device; }
void limit_embree_memory(int64_t bytes) { bytes_most = bytes; }
EmbreeMemory embree_memory() { return {bytes_now.load(), bytes_peak.load()}; }

void check_embree() {
  const int code = api.rtcGetDeviceError(device);
  if (code == 4) throw Error("out-of-memory", "Embree ran out of memory");
  if (code != 0) throw Error("embree", "Embree reported error " + std::to_string(code));
}

}  // namespace primray
