// Emission in volumes as lights: a row for each instance.
#include "build/lights/lights.hpp"

namespace primray {

void add_volume_lights(Scene& scene) {
  VolumeTable& volumes = *scene.volumes;
  LightTable& lights = scene.lights;
  for (size_t i = 0; i < volumes.in_emissions.size(); ++i) {
    const Box& box = volumes.in_emissions.boxes[i];
    float row[kLightFields] = {};
    put_int(row, kType, int(LightType::kVolume));
    row[kAxisX] = row[kAxisY + 1] = row[kAxisZ + 2] = row[kInverseX] = row[kInverseY + 1] = row[kInverseZ + 2] = 1;
    row[kDiffuseFactor] = row[kSpecularFactor] = row[kInverseDet] = 1;
    put(row, kOrigin, dvec3((box.low + box.high) * 0.5f));
    row[kSize0] = 0.5f * length(box.high - box.low);
    row[kImportance] = float(luminance(volumes.emitted_intensity(i)));
    if (!(row[kImportance] > 0)) continue;
    lights.rows.insert(lights.rows.end(), row, row + kLightFields);
    volumes.light_of[i] = lights.count++;
    add_light_rules(LightRules(), scene.scale, lights);
    lights.ends.back() = int32_t(kEndObject);  // as for rays that reach its emission
  }
  volumes.instance_of_light.assign(size_t(lights.count), -1);
  for (size_t i = 0; i < volumes.light_of.size(); ++i)
    if (volumes.light_of[i] >= 0) volumes.instance_of_light[size_t(volumes.light_of[i])] = int32_t(i);
}

}  // namespace primray
