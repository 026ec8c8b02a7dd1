#include "scene/cryptomatte.h"

#include <bit>
#include <cstdio>
#include <set>

#include <nlohmann/json.hpp>

namespace relief {

namespace {

constexpr std::string_view kLayers[kNumCryptomattes] = {"CryptoObject", "CryptoMaterial", "CryptoAsset"};

const std::string& instance_name(const Scene& scene, const Instance& instance)
{
  return instance.name.empty() ? scene.meshes[static_cast<std::size_t>(instance.mesh_index)].name : instance.name;
}

/// Calls `visit` with the name of each thing that a Cryptomatte tells apart, in the order of their indices.
template <class Visit>
void visit_names(const Scene& scene, int index, const Visit& visit)
{
  switch (static_cast<Aov>(kFirstCryptomatte + index)) {
    case Aov::kCryptoObject:
      for (const Instance& instance : scene.instances) visit(instance_name(scene, instance));
      break;
    case Aov::kCryptoMaterial:
      for (const std::string& name : scene.material_names) visit(name);
      break;
    default:
      for (const Instance& instance : scene.instances) visit(instance.asset);
      break;
  }
}

std::uint32_t id_bits(const std::string& name)
{
  return std::bit_cast<std::uint32_t>(cryptomatte_id(cryptomatte_hash(name)));
}

}  // namespace

std::uint32_t cryptomatte_hash(std::string_view name)
{
  constexpr std::uint32_t kFirst = 0xcc9e2d51u, kSecond = 0x1b873593u;
  const auto scramble = [](std::uint32_t k) { return std::rotl(k * kFirst, 15) * kSecond; };
  const auto byte = [&](std::size_t i) { return std::uint32_t{static_cast<unsigned char>(name[i])}; };
  const std::size_t whole = name.size() / 4 * 4;
  std::uint32_t h = 0;
  for (std::size_t i = 0; i < whole; i += 4) {
    h ^= scramble(byte(i) | byte(i + 1) << 8 | byte(i + 2) << 16 | byte(i + 3) << 24);
    h = std::rotl(h, 13) * 5 + 0xe6546b64u;
  }
  std::uint32_t rest = 0;
  for (std::size_t i = name.size(); i > whole; --i) rest = rest << 8 | byte(i - 1);
  h ^= scramble(rest);
  h ^= static_cast<std::uint32_t>(name.size());
  h = (h ^ h >> 16) * 0x85ebca6bu;
  h = (h ^ h >> 13) * 0xc2b2ae35u;
  return h ^ h >> 16;
}

float cryptomatte_id(std::uint32_t hash)
{
  const std::uint32_t exponent = hash >> 23 & 255u;
  if (exponent == 0 || exponent == 255) hash ^= 1u << 23;
  return std::bit_cast<float>(hash);
}

CryptomatteIds cryptomatte_ids(const Scene& scene, AovMask aov_mask)
{
  CryptomatteIds ids;
  for (int i = 0; i < kNumCryptomattes; ++i) {
    if (!aov_is_in(static_cast<Aov>(kFirstCryptomatte + i), aov_mask)) continue;
    visit_names(scene, i, [&](const std::string& name) {
      ids[static_cast<std::size_t>(i)].push_back(cryptomatte_id(cryptomatte_hash(name)));
    });
  }
  return ids;
}

std::string_view cryptomatte_layer(int index) { return kLayers[index]; }

std::string cryptomatte_manifest(const Scene& scene, int index)
{
  std::set<std::string> names;
  visit_names(scene, index, [&](const std::string& name) { names.insert(name); });
  nlohmann::json manifest = nlohmann::json::object();
  for (const std::string& name : names) {
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", id_bits(name));
    manifest[name] = digits;
  }
  // Names of hostile files need not be UTF-8.
  return manifest.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace relief
