#include "scene/animation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/gltf_accessor.h"

namespace relief {
namespace {

using Value = std::array<double, 4>;

Value normalized(const Value& q)
{
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return length > 0 ? Value{q[0] / length, q[1] / length, q[2] / length, q[3] / length} : Value{0, 0, 0, 1};
}

Value mix(const Value& a, const Value& b, double wa, double wb)
{
  Value out{};
  for (std::size_t i = 0; i < 4; ++i) {
    out[i] = wa * a[i] + wb * b[i];
  }
  return out;
}

/// Spherical interpolation along the shorter arc; where the arc is so short that its sine is all rounding, the straight
/// mix differs by less than that rounding.
Value slerp(const Value& from, Value to, double t)
{
  double cosine = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3];
  if (cosine < 0) {
    cosine = -cosine;
    to = mix(to, to, -1, 0);
  }
  const double angle = std::acos(std::min(cosine, 1.0));
  constexpr double kShortArc = 1e-6;
  if (angle < kShortArc) {
    return normalized(mix(from, to, 1 - t, t));
  }
  const double sine = std::sin(angle);
  return mix(from, to, std::sin((1 - t) * angle) / sine, std::sin(t * angle) / sine);
}

/// Group `group` of key `key` as numbers.
Value value_at(const AnimationCurve& curve, std::size_t key, std::size_t group, std::size_t num_groups)
{
  const auto n = static_cast<std::size_t>(curve.is_rotation ? 4 : curve.num_components);
  Value out{};
  for (std::size_t i = 0; i < n; ++i) {
    out[i] = static_cast<double>(curve.values[(key * num_groups + group) * n + i]);
  }
  return out;
}

/// @param values_a_key  1, or how many weights of morph targets stand one after the other
AnimationCurve read_curve(const GltfDocument& document,
                          const tinygltf::AnimationSampler& sampler,
                          bool is_rotation,
                          int num_components,
                          std::size_t values_a_key,
                          const std::string& path)
{
  AnimationCurve curve;
  curve.is_rotation = is_rotation;
  curve.num_components = num_components;
  curve.interpolation = sampler.interpolation == "STEP"          ? Interpolation::kStep
                        : sampler.interpolation == "CUBICSPLINE" ? Interpolation::kCubicSpline
                                                                 : Interpolation::kLinear;
  const AccessorView input =
      accessor_open(document, sampler.input, AccessorKind::kFloatOrNormalized, 1, 1, path + "/input");
  const int n = is_rotation ? 4 : num_components;
  const AccessorView output =
      accessor_open(document, sampler.output, AccessorKind::kFloatOrNormalized, n, n, path + "/output");
  const std::size_t groups = values_a_key * (curve.interpolation == Interpolation::kCubicSpline ? 3 : 1);
  if (output.count != input.count * groups) {
    throw SceneError(document.file, path + "/output",
                     std::to_string(input.count * groups) + " elements (" + std::to_string(groups) + " a key)",
                     std::to_string(output.count));
  }
  curve.times = accessor_read<float>(input);
  for (std::size_t i = 1; i < curve.times.size(); ++i) {
    if (!(curve.times[i] > curve.times[i - 1])) {
      throw SceneError(document.file, path + "/input", "times that increase",
                       number_text(static_cast<double>(curve.times[i])) + " after " +
                           number_text(static_cast<double>(curve.times[i - 1])));
    }
  }
  curve.values.resize(output.count * static_cast<std::size_t>(n));
  accessor_read_floats(output, 0, output.count, curve.values.data());
  return curve;
}

/// Morph targets of a mesh: of its first primitive, as all of its primitives have the same number.
std::size_t num_targets(const GltfDocument& document, int mesh)
{
  return mesh < 0 ? 0 : document.core.meshes[static_cast<std::size_t>(mesh)].primitives.front().targets.size();
}

/// Weights of a mesh's targets at a time.
/// @param curve  of one component, with `count` values a key
std::vector<double> sample_weights(const AnimationCurve& all, std::size_t count, double time_seconds)
{
  std::vector<double> out;
  const std::size_t num_values = all.values.size() / count;
  for (std::size_t target = 0; target < count; ++target) {
    AnimationCurve one{all.interpolation, false, all.times, std::vector<float>(num_values), 1};
    for (std::size_t i = 0; i < num_values; ++i) one.values[i] = all.values[i * count + target];
    out.push_back(animation_sample(one, time_seconds)[0]);
  }
  return out;
}

}  // namespace

std::array<double, 4> animation_sample(const AnimationCurve& curve, double time_seconds)
{
  const bool cubic = curve.interpolation == Interpolation::kCubicSpline;
  const std::size_t groups = cubic ? 3 : 1;
  const std::size_t middle = cubic ? 1 : 0;
  const auto finish = [&](const Value& v) { return curve.is_rotation ? normalized(v) : v; };
  const auto after = std::upper_bound(curve.times.begin(), curve.times.end(), time_seconds,
                                      [](double t, float key) { return t < static_cast<double>(key); });
  if (after == curve.times.begin()) {
    return finish(value_at(curve, 0, middle, groups));
  }
  const auto key = static_cast<std::size_t>(after - curve.times.begin()) - 1;
  if (after == curve.times.end() || curve.interpolation == Interpolation::kStep) {
    return finish(value_at(curve, key, middle, groups));
  }
  const double start = static_cast<double>(curve.times[key]);
  const double duration = static_cast<double>(*after) - start;
  const double t = (time_seconds - start) / duration;
  const Value from = value_at(curve, key, middle, groups), to = value_at(curve, key + 1, middle, groups);
  if (cubic) {
    const Value out_tangent = value_at(curve, key, 2, groups), in_tangent = value_at(curve, key + 1, 0, groups);
    const double t2 = t * t, t3 = t2 * t;
    const Value ends = mix(from, to, 2 * t3 - 3 * t2 + 1, 3 * t2 - 2 * t3);
    const Value tangents = mix(out_tangent, in_tangent, duration * (t3 - 2 * t2 + t), duration * (t3 - t2));
    return finish(mix(ends, tangents, 1, 1));
  }
  return curve.is_rotation ? slerp(normalized(from), normalized(to), t) : mix(from, to, 1 - t, t);
}

std::unordered_map<int, AnimatedPose> animation_pose(const GltfDocument& document,
                                                     double time_seconds,
                                                     Warnings& warnings)
{
  std::unordered_map<int, AnimatedPose> poses;
  for (std::size_t a = 0; a < document.core.animations.size(); ++a) {
    const tinygltf::Animation& animation = document.core.animations[a];
    const std::string path = "/animations/" + std::to_string(a);
    for (std::size_t c = 0; c < animation.channels.size(); ++c) {
      const tinygltf::AnimationChannel& channel = animation.channels[c];
      const std::string channel_path = path + "/channels/" + std::to_string(c);
      const std::string& target = channel.target_path;
      const bool is_rotation = target == "rotation", is_scale = target == "scale";
      const std::size_t count =
          channel.target_node < 0 || target != "weights"
              ? 0
              : num_targets(document, document.core.nodes[static_cast<std::size_t>(channel.target_node)].mesh);
      const bool is_weights = count > 0;
      if (channel.target_node < 0 || (!is_rotation && !is_scale && !is_weights && target != "translation")) {
        warnings.add(document.file + ": animation of \"" + target + "\" is not read");
        continue;
      }
      const auto node = static_cast<std::size_t>(channel.target_node);
      if (!is_weights && !document.core.nodes[node].matrix.empty()) {
        throw SceneError(document.file, channel_path + "/target/node", "a node with translation, rotation and scale",
                         "node " + std::to_string(node) + " with a matrix");
      }
      const std::string sampler_path = path + "/samplers/" + std::to_string(channel.sampler);
      const AnimationCurve curve = read_curve(document, animation.samplers[static_cast<std::size_t>(channel.sampler)],
                                              is_rotation, is_weights ? 1 : 3, is_weights ? count : 1, sampler_path);
      AnimatedPose& pose = poses[channel.target_node];
      const bool taken = is_rotation  ? pose.rotation.has_value()
                         : is_scale   ? pose.scale.has_value()
                         : is_weights ? !pose.weights.empty()
                                      : pose.translation.has_value();
      if (taken) {
        warnings.add(document.file + ": " + channel_path + ": " + target + " of node " + std::to_string(node) +
                     " is already animated by an earlier channel, which is used");
      } else if (is_weights) {
        pose.weights = sample_weights(curve, count, time_seconds);
      } else if (const Value v = animation_sample(curve, time_seconds); is_rotation) {
        pose.rotation = v;
      } else {
        (is_scale ? pose.scale : pose.translation) = Vec3d{v[0], v[1], v[2]};
      }
    }
  }
  return poses;
}

std::vector<AnimationClip> animation_clips(const GltfDocument& document)
{
  std::vector<AnimationClip> clips;
  for (std::size_t a = 0; a < document.core.animations.size(); ++a) {
    const tinygltf::Animation& animation = document.core.animations[a];
    AnimationClip clip{animation.name, std::numeric_limits<double>::infinity(), 0};
    for (std::size_t s = 0; s < animation.samplers.size(); ++s) {
      const std::string path = "/animations/" + std::to_string(a) + "/samplers/" + std::to_string(s) + "/input";
      const AccessorView input =
          accessor_open(document, animation.samplers[s].input, AccessorKind::kFloatOrNormalized, 1, 1, path);
      for (const float time : accessor_read<float>(input)) {
        clip.start = std::min(clip.start, static_cast<double>(time));
        clip.end = std::max(clip.end, static_cast<double>(time));
      }
    }
    clip.start = std::min(clip.start, clip.end);
    clips.push_back(std::move(clip));
  }
  return clips;
}

}  // namespace relief
