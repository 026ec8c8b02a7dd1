// Every broken file ends in one SceneError that says where and why, never in a crash or a wrong picture.
#include <gtest/gtest.h>

#include <functional>

#include "scene/load.h"
#include "tests/support/gltf_builder.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;

/// A scene that uses a bit of everything: textured and displaced material, camera, lights, animation, sparse accessor,
/// strided view, instancing, and all of relief's own extensions.
GltfBuilder full_scene()
{
  GltfBuilder b = test::square_scene();
  json& j = b.json;
  j["images"] = {{{"uri", test::kPixelPng}}, {{"uri", test::kGreyPixelPng}}};
  j["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}}};
  j["textures"] = {{{"source", 0}, {"sampler", 0}}, {{"source", 1}}};
  j["materials"] = {{{"name", "paint"},
                     {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"roughnessFactor", 0.5}}},
                     {"normalTexture", {{"index", 0}, {"scale", 1}}},
                     {"extensions",
                      {{"KHR_materials_ior", {{"ior", 1.4}}},
                       {"KHR_materials_volume", {{"thicknessFactor", 1}, {"attenuationDistance", 2}}},
                       {"RELIEF_displacement", {{"heightTexture", {{"index", 1}}}, {"scale", 0.1}}}}}}};
  j["meshes"][0]["primitives"][0]["material"] = 0;
  j["cameras"] = {{{"type", "perspective"},
                   {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}},
                   {"extensions", {{"RELIEF_camera", {{"apertureRadius", 0.1}}}}}}};
  j["extensions"] = {{"KHR_lights_punctual",
                      {{"lights", {{{"type", "spot"}, {"intensity", 3}, {"spot", {{"outerConeAngle", 0.5}}}}}}}},
                     {"RELIEF_render", {{"resolution", {32, 16}}, {"fps", 25}}},
                     {"RELIEF_environment", {{"strength", 2}}}};
  b.root_node({{"name", "camera"}, {"camera", 0}});                                                          // 1
  b.root_node({{"name", "lamp"}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});                // 2
  b.root_node({{"name", "panel"}, {"extensions", {{"RELIEF_area_light", {{"power", 10}, {"width", 2}}}}}});  // 3
  const int offsets = b.accessor<float>({0, 0, 0, 2, 0, 0}, "VEC3");
  b.root_node({{"mesh", 0},
               {"extensions",
                {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", offsets}}}}},
                 {"RELIEF_object", {{"castsShadow", false}}}}}});  // 4
  const int times = b.accessor<float>({0, 1}, "SCALAR");
  const int moves = b.accessor<float>({0, 0, 0, 1, 0, 0}, "VEC3");
  j["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
                      {"samplers", {{{"input", times}, {"output", moves}}}}}};
  return b;
}

struct BrokenFile {
  const char* name;
  std::function<void(GltfBuilder&)> damage;
  const char* json_path;  ///< exact
  const char* message;    ///< part of what()
};

/// Replaces the numbers of an accessor's view in the buffer.
void overwrite_float(GltfBuilder& b, int accessor, std::size_t element, float value)
{
  const json& view =
      b.json["bufferViews"][b.json["accessors"][static_cast<std::size_t>(accessor)]["bufferView"].get<std::size_t>()];
  std::memcpy(b.binary.data() + view["byteOffset"].get<std::size_t>() + element * 4, &value, 4);
}

void overwrite_u16(GltfBuilder& b, int accessor, std::size_t element, std::uint16_t value)
{
  const json& view =
      b.json["bufferViews"][b.json["accessors"][static_cast<std::size_t>(accessor)]["bufferView"].get<std::size_t>()];
  std::memcpy(b.binary.data() + view["byteOffset"].get<std::size_t>() + element * 2, &value, 2);
}

json& primitive(GltfBuilder& b) { return b.json["meshes"][0]["primitives"][0]; }
json& node_extension(GltfBuilder& b, std::size_t node, const char* name)
{
  return b.json["nodes"][node]["extensions"][name];
}
json& material_extension(GltfBuilder& b, const char* name) { return b.json["materials"][0]["extensions"][name]; }

// Accessors of full_scene: 0 P, 1 N, 2 uv, 3 indices, 4 instance offsets, 5 times, 6 moves.
const BrokenFile kBrokenFiles[] = {
    // The document
    {"no asset", [](auto& b) { b.json.erase("asset"); }, "/asset", "required"},
    {"asset without version", [](auto& b) { b.json["asset"] = json::object(); }, "/asset/version", "required"},
    {"version 1", [](auto& b) { b.json["asset"]["version"] = "1.0"; }, "/asset/version", "glTF 1.0"},
    {"version is a number", [](auto& b) { b.json["asset"]["version"] = 2; }, "/asset/version", "a string"},
    {"Draco required",
     [](auto& b) {
       b.json["extensionsRequired"] = {"KHR_texture_transform", "KHR_draco_mesh_compression"};
     },
     "/extensionsRequired/1", "\"KHR_draco_mesh_compression\", compressed meshes: `gltf-transform copy"},
    {"meshopt required", [](auto& b) { b.json["extensionsRequired"] = {"EXT_meshopt_compression"}; },
     "/extensionsRequired/0", "\"EXT_meshopt_compression\", compressed buffers: `gltf-transform copy"},
    {"KTX2 required", [](auto& b) { b.json["extensionsRequired"] = {"KHR_texture_basisu"}; }, "/extensionsRequired/0",
     "\"KHR_texture_basisu\", KTX2 textures: `ktx extract`"},
    {"extensionsRequired is a string", [](auto& b) { b.json["extensionsRequired"] = "x"; }, "/extensionsRequired",
     "an array"},
    {"extensionsUsed holds a number", [](auto& b) { b.json["extensionsUsed"] = {7}; }, "/extensionsUsed/0", "a string"},
    {"nodes is an object", [](auto& b) { b.json["nodes"] = json::object(); }, "/nodes", "an array"},
    {"node is a number", [](auto& b) { b.json["nodes"][0] = 3; }, "/nodes/0", "an object"},
    {"default scene out of range", [](auto& b) { b.json["scene"] = 1; }, "/scene", "/scenes (which has 1)"},
    // Buffers
    {"buffer without uri",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}}};
     },
     "/buffers/0/uri", "a uri"},
    {"buffer file missing",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}, {"uri", "none.bin"}}};
     },
     "/buffers/0/uri", "none.bin"},
    {"buffer is a device",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}, {"uri", "/dev/zero"}}};
     },
     "/buffers/0/uri", "an existing file"},
    {"buffer is a folder",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}, {"uri", "."}}};
     },
     "/buffers/0/uri", "an existing file"},
    {"buffer from the network",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}, {"uri", "http://a/b.bin"}}};
     },
     "/buffers/0/uri", "relative"},
    {"buffer shorter than it says",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 400}, {"uri", "data:;base64,AAAA"}}};
     },
     "/buffers/0/byteLength", "3 bytes"},
    {"buffer not base64",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}, {"uri", "data:;base64,AA*A"}}};
     },
     "/buffers/0/uri", "position"},
    {"buffer data URI without encoding",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 4}, {"uri", "data:,AAAA"}}};
     },
     "/buffers/0/uri", ";base64,"},
    {"buffer of negative length",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", -1}, {"uri", "data:;base64,AAAA"}}};
     },
     "/buffers/0/byteLength", "-1"},
    {"buffer of fractional length",
     [](auto& b) {
       b.json["buffers"] = {{{"byteLength", 1.5}, {"uri", "data:;base64,AAAA"}}};
     },
     "/buffers/0/byteLength", "an integer"},
    {"view without buffer", [](auto& b) { b.json["bufferViews"][0].erase("buffer"); }, "/bufferViews/0/buffer",
     "required"},
    {"view of no buffer", [](auto& b) { b.json["bufferViews"][0]["buffer"] = 9; }, "/bufferViews/0/buffer", "/buffers"},
    {"view beyond its buffer", [](auto& b) { b.json["bufferViews"][0]["byteLength"] = 100000; }, "/bufferViews/0",
     "within"},
    {"view offset near 2^53", [](auto& b) { b.json["bufferViews"][0]["byteOffset"] = 9007199254740991; },
     "/bufferViews/0", "within"},
    {"view offset beyond 2^64", [](auto& b) { b.json["bufferViews"][0]["byteOffset"] = 1e30; },
     "/bufferViews/0/byteOffset", "an integer"},
    {"stride below an element", [](auto& b) { b.json["bufferViews"][0]["byteStride"] = 8; },
     "/bufferViews/0/byteStride", "12 bytes"},
    {"stride not a multiple of 4", [](auto& b) { b.json["bufferViews"][0]["byteStride"] = 14; },
     "/bufferViews/0/byteStride", "multiple of 4"},
    {"stride of 1000", [](auto& b) { b.json["bufferViews"][0]["byteStride"] = 1000; }, "/bufferViews/0/byteStride",
     "252"},
    {"stride runs out of the view", [](auto& b) { b.json["bufferViews"][0]["byteStride"] = 16; }, "/accessors/0",
     "16 apart"},
    // Accessors
    {"accessor count too large", [](auto& b) { b.json["accessors"][0]["count"] = 5; }, "/accessors/0", "5 elements"},
    {"accessor count absurd", [](auto& b) { b.json["accessors"][0]["count"] = 4503599627370496; }, "/accessors/0",
     "elements within"},
    {"accessor count absurd without data",
     [](auto& b) {
       b.json["accessors"][0]["count"] = 4503599627370496;
       b.json["accessors"][0].erase("bufferView");
     },
     "/accessors/0/count", "without a bufferView"},
    {"accessor count 0", [](auto& b) { b.json["accessors"][0]["count"] = 0; }, "/accessors/0/count",
     "an integer within 1"},
    {"accessor offset beyond its view", [](auto& b) { b.json["accessors"][0]["byteOffset"] = 1000; }, "/accessors/0",
     "from byte 1000"},
    {"accessor type unknown", [](auto& b) { b.json["accessors"][0]["type"] = "VEC5"; }, "/accessors/0/type", "VEC4"},
    {"accessor component type unknown", [](auto& b) { b.json["accessors"][0]["componentType"] = 5124; },
     "/accessors/0/componentType", "5124"},
    {"accessor of no view", [](auto& b) { b.json["accessors"][0]["bufferView"] = 99; }, "/accessors/0/bufferView",
     "/bufferViews"},
    {"accessor normalized is a number", [](auto& b) { b.json["accessors"][0]["normalized"] = 1; },
     "/accessors/0/normalized", "true or false"},
    {"sparse without indices",
     [](auto& b) {
       b.json["accessors"][0]["sparse"] = {{"count", 1}, {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices", "required"},
    {"sparse count above count",
     [](auto& b) {
       b.json["accessors"][0]["sparse"] = {
           {"count", 9}, {"indices", {{"bufferView", 0}, {"componentType", 5123}}}, {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/count", "at most"},
    {"sparse indices of float",
     [](auto& b) {
       b.json["accessors"][0]["sparse"] = {
           {"count", 1}, {"indices", {{"bufferView", 0}, {"componentType", 5122}}}, {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices/componentType", "5122"},
    {"sparse index out of range",
     [](auto& b) {
       const int v = b.template view<std::uint16_t>({1, 4});
       b.json["accessors"][0]["sparse"] = {
           {"count", 2}, {"indices", {{"bufferView", v}, {"componentType", 5123}}}, {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices", "4 at position 1"},
    {"sparse indices not increasing",
     [](auto& b) {
       const int v = b.template view<std::uint16_t>({2, 1});
       b.json["accessors"][0]["sparse"] = {
           {"count", 2}, {"indices", {{"bufferView", v}, {"componentType", 5123}}}, {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices", "increasing"},
    {"sparse values beyond their view",
     [](auto& b) {
       const int v = b.template view<std::uint16_t>({1, 2});
       b.json["accessors"][0]["sparse"] = {
           {"count", 2}, {"indices", {{"bufferView", v}, {"componentType", 5123}}}, {"values", {{"bufferView", v}}}};
     },
     "/accessors/0/sparse/values", "within"},
    {"NaN position", [](auto& b) { overwrite_float(b, 0, 4, NAN); }, "/accessors/0", "NaN in element 1"},
    {"infinite normal", [](auto& b) { overwrite_float(b, 1, 11, INFINITY); }, "/accessors/1", "infinity in element 3"},
    // Meshes
    {"mesh without primitives", [](auto& b) { b.json["meshes"][0] = json::object(); }, "/meshes/0/primitives",
     "required"},
    {"mesh with no primitive", [](auto& b) { b.json["meshes"][0]["primitives"] = json::array(); },
     "/meshes/0/primitives", "not empty"},
    {"no position", [](auto& b) { primitive(b)["attributes"].erase("POSITION"); },
     "/meshes/0/primitives/0/attributes/POSITION", "nothing"},
    {"position is VEC2", [](auto& b) { primitive(b)["attributes"]["POSITION"] = 2; },
     "/meshes/0/primitives/0/attributes/POSITION", "VEC3"},
    {"position of uint", [](auto& b) { b.json["accessors"][0]["componentType"] = 5125; },
     "/meshes/0/primitives/0/attributes/POSITION", "UNSIGNED_INT"},
    {"attribute of no accessor", [](auto& b) { primitive(b)["attributes"]["NORMAL"] = 77; },
     "/meshes/0/primitives/0/attributes/NORMAL", "/accessors"},
    {"attribute is negative", [](auto& b) { primitive(b)["attributes"]["NORMAL"] = -1; },
     "/meshes/0/primitives/0/attributes/NORMAL", "-1"},
    {"normals fewer than positions", [](auto& b) { b.json["accessors"][1]["count"] = 3; },
     "/meshes/0/primitives/0/attributes/NORMAL", "(4)"},
    {"uv is VEC3", [](auto& b) { primitive(b)["attributes"]["TEXCOORD_0"] = 1; },
     "/meshes/0/primitives/0/attributes/TEXCOORD_0", "VEC2"},
    {"index out of range", [](auto& b) { overwrite_u16(b, 3, 5, 4); }, "/meshes/0/primitives/0/indices",
     "4 at position 5"},
    {"index is the restart value", [](auto& b) { overwrite_u16(b, 3, 2, 0xffff); }, "/meshes/0/primitives/0/indices",
     "restart"},
    {"indices of float", [](auto& b) { primitive(b)["indices"] = 5; }, "/meshes/0/primitives/0/indices", "unsigned"},
    {"indices without data", [](auto& b) { b.json["accessors"][3].erase("bufferView"); },
     "/meshes/0/primitives/0/indices", "bufferView"},
    {"indices not a multiple of three", [](auto& b) { b.json["accessors"][3]["count"] = 5; }, "/meshes/0/primitives/0",
     "multiple of 3"},
    {"strip of two corners",
     [](auto& b) {
       primitive(b)["mode"] = 5;
       b.json["accessors"][3]["count"] = 2;
     },
     "/meshes/0/primitives/0", "at least 3"},
    {"triangles as curves", [](auto& b) { primitive(b)["extensions"]["RELIEF_curves"] = json::object(); },
     "/meshes/0/primitives/0/mode", "lines"},
    {"curves without radii",
     [](auto& b) {
       primitive(b)["mode"] = 3;
       primitive(b)["extensions"]["RELIEF_curves"] = json::object();
     },
     "/meshes/0/primitives/0/attributes/_RADIUS", "nothing"},
    {"curves of an unknown shape",
     [](auto& b) {
       primitive(b)["mode"] = 3;
       primitive(b)["extensions"]["RELIEF_curves"]["shape"] = "square";
     },
     "/meshes/0/primitives/0/extensions/RELIEF_curves/shape", "\"ribbons\""},
    {"mode 7", [](auto& b) { primitive(b)["mode"] = 7; }, "/meshes/0/primitives/0/mode", "7"},
    {"material out of range", [](auto& b) { primitive(b)["material"] = 5; }, "/meshes/0/primitives/0/material",
     "/materials"},
    // Nodes
    {"node cycle",
     [](auto& b) {
       b.json["scenes"][0]["nodes"] = {2};
       b.json["nodes"][0]["children"] = {1};
       b.json["nodes"][1]["children"] = {0};
     },
     "/nodes/0/children", "cycle"},
    {"node is its own child",
     [](auto& b) {
       b.json["scenes"][0]["nodes"] = {2};
       b.json["nodes"][0]["children"] = {0};
     },
     "/nodes/0/children", "cycle"},
    {"child out of range", [](auto& b) { b.json["nodes"][0]["children"] = {99}; }, "/nodes/0/children/0", "/nodes"},
    {"matrix of 15", [](auto& b) { b.json["nodes"][0]["matrix"] = std::vector<double>(15, 1.0); }, "/nodes/0/matrix",
     "16"},
    {"projective matrix",
     [](auto& b) { b.json["nodes"][0]["matrix"] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; },
     "/nodes/0/matrix", "affine"},
    {"translation holds a string",
     [](auto& b) {
       b.json["nodes"][0]["translation"] = {0, "x", 0};
     },
     "/nodes/0/translation/1", "finite number"},
    {"scale beyond single precision",
     [](auto& b) {
       b.json["nodes"][0]["scale"] = {1e300, 1, 1};
     },
     "/nodes/0/scale/0", "finite number"},
    {"positions beyond a tenth of a light-year",
     [](auto& b) {
       b.json["nodes"][0]["scale"] = {1e20, 1e20, 1e20};
     },
     "/nodes/0", "1e15"},
    // Cameras, lights
    {"camera beyond a tenth of a light-year",
     [](auto& b) {
       b.json["nodes"][1]["translation"] = {0, 2e18, 0};
     },
     "/nodes/1", "1e15"},
    {"endless focus with an open aperture",
     [](auto& b) {
       b.json["cameras"][0]["extensions"]["RELIEF_camera"]["apertureRadius"] = 0.1;
       b.json["cameras"][0]["extensions"]["RELIEF_camera"]["focusDistance"] = 1e30;
     },
     "/cameras/0/extensions/RELIEF_camera/focusDistance", "1e15"},
    {"endless aperture", [](auto& b) { b.json["cameras"][0]["extensions"]["RELIEF_camera"]["apertureRadius"] = 1e19; },
     "/cameras/0/extensions/RELIEF_camera/apertureRadius", "within"},
    {"light beyond a tenth of a light-year",
     [](auto& b) {
       b.json["nodes"][2]["translation"] = {0, 2e18, 0};
     },
     "/nodes/2", "1e15"},
    {"light of endless size",
     [](auto& b) {
       b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["extensions"]["RELIEF_light"]["radius"] = 1e19;
     },
     "/extensions/KHR_lights_punctual/lights/0/extensions/RELIEF_light/radius", "1e+15"},
    {"camera out of range", [](auto& b) { b.json["nodes"][1]["camera"] = 1; }, "/nodes/1/camera", "/cameras"},
    {"camera without its part", [](auto& b) { b.json["cameras"][0].erase("perspective"); }, "/cameras/0/perspective",
     "nothing"},
    {"camera of another type", [](auto& b) { b.json["cameras"][0]["type"] = "fisheye"; }, "/cameras/0/type",
     "perspective"},
    {"field of view 0", [](auto& b) { b.json["cameras"][0]["perspective"]["yfov"] = 0; }, "/cameras/0/perspective/yfov",
     "a number within"},
    {"orthographic of endless size",
     [](auto& b) {
       b.json["cameras"][0] = {{"type", "orthographic"},
                               {"orthographic", {{"xmag", 1e30}, {"ymag", 1}, {"zfar", 1}, {"znear", 0}}}};
     },
     "/cameras/0/orthographic", "1e15"},
    {"orthographic of no size",
     [](auto& b) {
       b.json["cameras"][0] = {{"type", "orthographic"},
                               {"orthographic", {{"xmag", 0}, {"ymag", 1}, {"zfar", 1}, {"znear", 0}}}};
     },
     "/cameras/0/orthographic", "other than 0"},
    {"negative aperture", [](auto& b) { b.json["cameras"][0]["extensions"]["RELIEF_camera"]["apertureRadius"] = -1; },
     "/cameras/0/extensions/RELIEF_camera/apertureRadius", "-1"},
    {"clip end before start",
     [](auto& b) {
       b.json["cameras"][0]["extensions"]["RELIEF_camera"]["clip"] = {2, 1};
     },
     "/cameras/0/extensions/RELIEF_camera/clip", "beyond"},
    {"light out of range", [](auto& b) { node_extension(b, 2, "KHR_lights_punctual")["light"] = 1; },
     "/nodes/2/extensions/KHR_lights_punctual/light", "one of 1 lights"},
    {"light of another type",
     [](auto& b) { b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["type"] = "laser"; },
     "/extensions/KHR_lights_punctual/lights/0/type", "\"spot\""},
    {"light of negative intensity",
     [](auto& b) { b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = -1; },
     "/extensions/KHR_lights_punctual/lights/0/intensity", "-1"},
    {"spot inner cone beyond the outer",
     [](auto& b) { b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"]["innerConeAngle"] = 1; },
     "/extensions/KHR_lights_punctual/lights/0/spot/innerConeAngle", "0.5"},
    // Textures and materials
    {"texture out of range", [](auto& b) { b.json["materials"][0]["normalTexture"]["index"] = 4; },
     "/materials/0/normalTexture/index", "/textures"},
    {"texture without source", [](auto& b) { b.json["textures"][0].erase("source"); }, "/textures/0/source",
     "an image"},
    {"third set of uv", [](auto& b) { b.json["materials"][0]["normalTexture"]["texCoord"] = 2; },
     "/materials/0/normalTexture/texCoord", "within 0…1"},
    {"wrap mode unknown", [](auto& b) { b.json["samplers"][0]["wrapS"] = 10498; }, "/samplers/0/wrapS", "10497"},
    {"image of nothing", [](auto& b) { b.json["images"][0] = json::object(); }, "/images/0", "neither"},
    {"image of both", [](auto& b) { b.json["images"][0]["bufferView"] = 0; }, "/images/0", "both"},
    {"image file missing", [](auto& b) { b.json["images"][0]["uri"] = "lost.png"; }, "/images/0/uri", "lost.png"},
    {"image is no image", [](auto& b) { b.json["images"][0]["uri"] = "data:image/png;base64,AAAA"; }, "/images/0",
     "image"},
    {"base colour of 3",
     [](auto& b) {
       b.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1};
     },
     "/materials/0/pbrMetallicRoughness/baseColorFactor", "array of 4"},
    {"index of refraction 0.5", [](auto& b) { material_extension(b, "KHR_materials_ior")["ior"] = 0.5; },
     "/materials/0/extensions/KHR_materials_ior/ior", "≥ 1"},
    {"attenuation distance 0",
     [](auto& b) { material_extension(b, "KHR_materials_volume")["attenuationDistance"] = 0; },
     "/materials/0/extensions/KHR_materials_volume/attenuationDistance", "> 0"},
    {"extension is an array", [](auto& b) { material_extension(b, "KHR_materials_ior") = json::array(); },
     "/materials/0/extensions/KHR_materials_ior", "an object"},
    {"extensions is an array", [](auto& b) { b.json["materials"][0]["extensions"] = json::array(); },
     "/materials/0/extensions", "an object"},
    // Instancing
    {"instancing without attributes", [](auto& b) { node_extension(b, 4, "EXT_mesh_gpu_instancing") = json::object(); },
     "/nodes/4/extensions/EXT_mesh_gpu_instancing/attributes", "an object"},
    {"instancing counts differ",
     [](auto& b) { node_extension(b, 4, "EXT_mesh_gpu_instancing")["attributes"]["SCALE"] = 0; },
     "/nodes/4/extensions/EXT_mesh_gpu_instancing/attributes", "equal counts"},
    {"instancing of wrong type",
     [](auto& b) { node_extension(b, 4, "EXT_mesh_gpu_instancing")["attributes"]["ROTATION"] = 4; },
     "/nodes/4/extensions/EXT_mesh_gpu_instancing/attributes/ROTATION", "VEC4"},
    // Animations (at frame 10)
    {"animation sampler out of range", [](auto& b) { b.json["animations"][0]["channels"][0]["sampler"] = 1; },
     "/animations/0/channels/0/sampler", "below 1"},
    {"animation of no node", [](auto& b) { b.json["animations"][0]["channels"][0]["target"]["node"] = 50; },
     "/animations/0/channels/0/target/node", "/nodes"},
    {"animation times not increasing", [](auto& b) { overwrite_float(b, 5, 1, 0); }, "/animations/0/samplers/0/input",
     "increase"},
    {"animation output too short", [](auto& b) { b.json["accessors"][6]["count"] = 1; },
     "/animations/0/samplers/0/output", "2 elements"},
    {"animation spline needs three a key",
     [](auto& b) { b.json["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE"; },
     "/animations/0/samplers/0/output", "6 elements"},
    {"animation of a matrix node",
     [](auto& b) { b.json["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; },
     "/animations/0/channels/0/target/node", "matrix"},
    {"animation rotates by three numbers",
     [](auto& b) { b.json["animations"][0]["channels"][0]["target"]["path"] = "rotation"; },
     "/animations/0/samplers/0/output", "VEC4"},
    // relief's own
    {"resolution 0",
     [](auto& b) {
       b.json["extensions"]["RELIEF_render"]["resolution"] = {0, 5};
     },
     "/extensions/RELIEF_render/resolution/0", "65536"},
    {"resolution of one number", [](auto& b) { b.json["extensions"]["RELIEF_render"]["resolution"] = {5}; },
     "/extensions/RELIEF_render/resolution", "2 numbers"},
    {"half a pixel", [](auto& b) { b.json["extensions"]["RELIEF_render"]["resolution"] = {5.5, 5}; },
     "/extensions/RELIEF_render/resolution", "two integers"},
    {"samples 0", [](auto& b) { b.json["extensions"]["RELIEF_render"]["samples"] = 0; },
     "/extensions/RELIEF_render/samples", "an integer"},
    {"frame range backwards", [](auto& b) { b.json["extensions"]["RELIEF_render"]["frameRange"] = {5, 1}; },
     "/extensions/RELIEF_render/frameRange", "after"},
    {"filter unknown", [](auto& b) { b.json["extensions"]["RELIEF_render"]["pixelFilter"] = {{"type", "lanczos"}}; },
     "/extensions/RELIEF_render/pixelFilter/type", "blackman-harris"},
    {"caustics mode maybe", [](auto& b) { b.json["extensions"]["RELIEF_render"]["caustics"] = {{"mode", "maybe"}}; },
     "/extensions/RELIEF_render/caustics/mode", "\"auto\""},
    {"caustics photons -1", [](auto& b) { b.json["extensions"]["RELIEF_render"]["caustics"] = {{"photons", -1}}; },
     "/extensions/RELIEF_render/caustics/photons", "-1"},
    {"caustics alpha 2", [](auto& b) { b.json["extensions"]["RELIEF_render"]["caustics"] = {{"alpha", 2}}; },
     "/extensions/RELIEF_render/caustics/alpha", "2"},
    {"caustics radius beyond any scene",
     [](auto& b) { b.json["extensions"]["RELIEF_render"]["caustics"] = {{"radius", 1e30}}; },
     "/extensions/RELIEF_render/caustics/radius", "1e+30"},
    {"environment file missing", [](auto& b) { b.json["extensions"]["RELIEF_environment"]["uri"] = "sky.hdr"; },
     "/extensions/RELIEF_environment/uri", "sky.hdr"},
    {"environment image out of range", [](auto& b) { b.json["extensions"]["RELIEF_environment"]["image"] = 3; },
     "/extensions/RELIEF_environment/image", "images"},
    {"environment colour negative", [](auto& b) { b.json["extensions"]["RELIEF_environment"]["color"] = {1, -1, 1}; },
     "/extensions/RELIEF_environment/color/1", "-1"},
    {"area light with power and radiance", [](auto& b) { node_extension(b, 3, "RELIEF_area_light")["radiance"] = 1; },
     "/nodes/3/extensions/RELIEF_area_light", "both"},
    {"area light with neither", [](auto& b) { node_extension(b, 3, "RELIEF_area_light").erase("power"); },
     "/nodes/3/extensions/RELIEF_area_light", "neither"},
    {"area light with hardly any spread", [](auto& b) { node_extension(b, 3, "RELIEF_area_light")["spread"] = 0.001; },
     "/nodes/3/extensions/RELIEF_area_light/spread", "0.001"},
    {"graph of an area light without outputs",
     [](auto& b) { node_extension(b, 3, "RELIEF_area_light")["graph"] = {{"nodes", json::array()}}; },
     "/nodes/3/extensions/RELIEF_area_light/graph/outputs", "an object"},
    {"graph of an area light that gives something else",
     [](auto& b) {
       node_extension(b, 3, "RELIEF_area_light")["graph"] = {{"nodes", {{{"type", "geometry"}}}},
                                                             {"outputs", {{"color", {{"node", 0}}}}}};
     },
     "/nodes/3/extensions/RELIEF_area_light/graph/outputs/emission", "node"},
    {"luminaire without a file",
     [](auto& b) {
       b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["extensions"]["RELIEF_light"]["graph"] = {
           {"nodes", {{{"type", "ies-texture"}}}}, {"outputs", {{"emission", {{"node", 0}}}}}};
     },
     "/extensions/KHR_lights_punctual/lights/0/extensions/RELIEF_light/graph/nodes/0/uri", "an IES file"},
    {"luminaire's file missing",
     [](auto& b) {
       b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["extensions"]["RELIEF_light"]["graph"] = {
           {"nodes", {{{"type", "ies-texture"}, {"uri", "no.ies"}}}}, {"outputs", {{"emission", {{"node", 0}}}}}};
     },
     "/extensions/KHR_lights_punctual/lights/0/extensions/RELIEF_light/graph/nodes/0/uri", "no.ies"},
    {"area light beyond single precision", [](auto& b) { b.json["nodes"][3]["scale"] = {1e-30, 1e-30, 1}; },
     "/nodes/3/extensions/RELIEF_area_light", "1e-20"},
    {"object setting is a number", [](auto& b) { node_extension(b, 4, "RELIEF_object")["castsShadow"] = 1; },
     "/nodes/4/extensions/RELIEF_object/castsShadow", "true or false"},
    {"caustic caster maybe", [](auto& b) { node_extension(b, 4, "RELIEF_object")["causticCaster"] = "maybe"; },
     "/nodes/4/extensions/RELIEF_object/causticCaster", "auto"},
    {"displacement of nothing", [](auto& b) { material_extension(b, "RELIEF_displacement") = json::object(); },
     "/materials/0/extensions/RELIEF_displacement", "heightTexture"},
    {"displacement midlevel", [](auto& b) { material_extension(b, "RELIEF_displacement")["midlevel"] = 1e39; },
     "/materials/0/extensions/RELIEF_displacement/midlevel", "a number"},
    {"displacement method unknown", [](auto& b) { material_extension(b, "RELIEF_displacement")["method"] = "magic"; },
     "/materials/0/extensions/RELIEF_displacement/method", "\"rmip\""},
    {"displacement lod is a word", [](auto& b) { material_extension(b, "RELIEF_displacement")["lod"] = "fine"; },
     "/materials/0/extensions/RELIEF_displacement/lod", "auto"},
    {"displacement map missing",
     [](auto& b) { material_extension(b, "RELIEF_displacement")["heightTexture"] = {{"uri", "h.exr"}}; },
     "/materials/0/extensions/RELIEF_displacement/heightTexture/uri", "h.exr"},
    {"reference without uri", [](auto& b) { node_extension(b, 2, "RELIEF_reference") = json::object(); },
     "/nodes/2/extensions/RELIEF_reference/uri", "a path"},
    {"reference to itself", [](auto& b) { node_extension(b, 2, "RELIEF_reference")["uri"] = "scene.gltf"; },
     "/nodes/2/extensions/RELIEF_reference/uri", "cycle"},
    {"reference to nothing", [](auto& b) { node_extension(b, 2, "RELIEF_reference")["uri"] = "tree.glb"; },
     "/nodes/2/extensions/RELIEF_reference/uri", "tree.glb"},
};

class BrokenFiles : public testing::TestWithParam<std::size_t> {};

TEST_P(BrokenFiles, GiveOneClearError)
{
  const BrokenFile& broken = kBrokenFiles[GetParam()];
  SCOPED_TRACE(broken.name);
  GltfBuilder b = full_scene();
  broken.damage(b);
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.write("scene.gltf", b.gltf());
  LoadOptions options;
  options.has_frame = true;
  options.frame = 10;
  try {
    scene_load(file, options);
    FAIL() << broken.name << " was accepted";
  } catch (const SceneError& e) {
    const std::string text = e.what();
    EXPECT_EQ(e.file, file.string());
    EXPECT_EQ(e.json_path, broken.json_path) << text;
    EXPECT_NE(text.find(broken.message), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
  }
}

INSTANTIATE_TEST_SUITE_P(All, BrokenFiles, testing::Range<std::size_t>(0, std::size(kBrokenFiles)));

TEST(BrokenFilesTable, StartsFromAGoodFile)
{
  const test::TemporaryFolder folder;
  LoadOptions options;
  options.has_frame = true;
  options.frame = 10;
  const Scene scene = scene_load(folder.write("scene.gltf", full_scene().gltf()), options);
  EXPECT_EQ(scene.instances.size(), 3u);
  EXPECT_EQ(scene.lights.size(), 2u);
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
}

struct BrokenBytes {
  const char* name;
  std::function<std::string(const GltfBuilder&)> bytes;
  const char* message;
};

/// Four bytes of a number in little-endian order.
std::string u32(std::uint32_t x) { return {reinterpret_cast<const char*>(&x), 4}; }

const BrokenBytes kBrokenBytes[] = {
    {"empty file", [](const auto&) { return std::string(); }, "JSON"},
    {"a Git LFS pointer",
     [](const auto&) {
       return std::string("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n");
     },
     "git lfs pull"},
    {"an OpenEXR image", [](const auto&) { return std::string("\x76\x2f\x31\x01\2\0\0\0", 8); }, "an OpenEXR image"},
    {"a GIF image", [](const auto&) { return std::string("GIF89a"); }, "a GIF image"},
    {"a Blender file", [](const auto&) { return std::string("BLENDER-v304RENDH"); }, "a Blender file"},
    {"glTF 1.0 without a version",
     [](const auto&) { return std::string("{\"nodes\": {\"n\": {}}, \"scene\": \"s\"}"); }, "glTF 1.0"},
    {"not JSON", [](const auto&) { return std::string("v 0 0 0\nf 1 2 3"); }, "line 1, column 1"},
    {"JSON cut short", [](const auto& b) { return b.gltf().substr(0, 100); }, "JSON"},
    {"an array", [](const auto&) { return std::string("[1, 2]"); }, "an object"},
    {"a number beyond double", [](const auto&) { return std::string("{\"asset\": 1e999}"); }, "1e999"},
    {"not UTF-8", [](const auto&) { return std::string("{\"a\": \"\xff\xfe\"}"); }, "UTF-8"},
    {"a hundred thousand brackets", [](const auto&) { return "{\"a\":" + std::string(100000, '['); }, "100001 levels"},
    {"a hundred thousand objects deep",
     [](const auto&) {
       std::string s;
       for (int i = 0; i < 100000; ++i) s += "{\"a\":";
       return s;
     },
     "levels"},
    {"GLB of four bytes", [](const auto&) { return std::string("glTF"); }, "20 bytes"},
    {"GLB version 1",
     [](const auto& b) {
       std::string s = b.glb();
       s[4] = 1;
       return s;
     },
     "GLB version 2"},
    {"GLB cut short", [](const auto& b) { return b.glb().substr(0, 200); }, "as its header says"},
    {"GLB length 0", [](const auto& b) { return b.glb().replace(8, 4, u32(0)); }, "as its header says"},
    {"GLB JSON chunk too long", [](const auto& b) { return b.glb().replace(12, 4, u32(0xfffffff0)); },
     "chunk of 4294967280"},
    {"GLB without JSON first", [](const auto& b) { return b.glb().replace(16, 4, std::string("BIN\0", 4)); },
     "JSON chunk first"},
    {"GLB with a stump of a chunk", [](const auto&) { return "glTF" + u32(2) + u32(26) + u32(2) + "JSON{}1234"; },
     "chunk header"},
    {"GLB without its buffer",
     [](const auto& b) {
       GltfBuilder c = b;
       c.binary.clear();
       c.json["buffers"] = {{{"byteLength", 8}}};
       return c.glb();
     },
     "/buffers/0/uri"},
};

class BrokenContainers : public testing::TestWithParam<std::size_t> {};

TEST_P(BrokenContainers, GiveOneClearError)
{
  const BrokenBytes& broken = kBrokenBytes[GetParam()];
  SCOPED_TRACE(broken.name);
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.write("scene.glb", broken.bytes(test::square_scene()));
  try {
    scene_load(file);
    FAIL() << broken.name << " was accepted";
  } catch (const SceneError& e) {
    const std::string text = e.what();
    EXPECT_NE(text.find(broken.message), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
  }
}

INSTANTIATE_TEST_SUITE_P(All, BrokenContainers, testing::Range<std::size_t>(0, std::size(kBrokenBytes)));

TEST(BrokenFilesTable, AFileThatIsNotThereIsNamed)
{
  const test::TemporaryFolder folder;
  try {
    scene_load(folder / "none.gltf");
    FAIL();
  } catch (const SceneError& e) {
    EXPECT_NE(std::string(e.what()).find("none.gltf"), std::string::npos);
  }
  EXPECT_THROW(scene_load("/dev/zero"), SceneError);
  EXPECT_THROW(scene_load(folder / ""), SceneError);
}

// Every prefix of a good file is a bad one, and none may crash.
TEST(BrokenFilesTable, EveryPrefixOfAGlbIsRefused)
{
  const test::TemporaryFolder folder;
  const std::string good = test::square_scene().glb();
  for (std::size_t n = 0; n < good.size(); n += 3) {
    EXPECT_THROW(scene_load(folder.write("cut.glb", std::string_view(good).substr(0, n))), SceneError) << n;
  }
}

}  // namespace
}  // namespace relief
