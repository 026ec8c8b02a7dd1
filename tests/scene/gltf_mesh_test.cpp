// Geometry: every way glTF has of writing the same triangles ends in the same mesh.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/loaded_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;
using test::has_warning;

Scene load_glb(const GltfBuilder& b)
{
  const test::TemporaryFolder folder;
  return scene_load(folder.write("scene.glb", b.glb()));
}

/// Scene of one mesh with one primitive.
Mesh load_mesh(GltfBuilder& b, const json& primitive)
{
  b.root_node({{"mesh", b.mesh(primitive)}});
  Scene scene = load_glb(b);
  EXPECT_EQ(scene.meshes.size(), 1u);
  return scene.meshes.at(0);
}

void expect_near(Vec3f a, Vec3f b, float tolerance)
{
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

/// Corners of a triangle in world order.
std::vector<Vec3f> corners(const Mesh& mesh)
{
  std::vector<Vec3f> out;
  for (const TriangleIndices& t : mesh.triangles) {
    out.insert(out.end(), {mesh.P[t.v0], mesh.P[t.v1], mesh.P[t.v2]});
  }
  return out;
}

const std::vector<float> kSquare{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

TEST(GltfMesh, TakesIndicesOfEveryWidth)
{
  const std::vector<Vec3f> expected{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  const auto check = [&](auto index) {
    GltfBuilder b;
    using Index = decltype(index);
    const int P = b.accessor(kSquare, "VEC3");
    const int indices = b.accessor<Index>({0, 1, 2, 0, 2, 3}, "SCALAR");
    EXPECT_EQ(corners(load_mesh(b, {{"attributes", {{"POSITION", P}}}, {"indices", indices}})), expected);
  };
  check(std::uint8_t{});
  check(std::uint16_t{});
  check(std::uint32_t{});
}

TEST(GltfMesh, TakesTrianglesWithoutIndices)
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 0, 0, 6, 0, 0, 5, 1, 0}, "VEC3");
  const Mesh mesh = load_mesh(b, {{"attributes", {{"POSITION", P}}}});
  ASSERT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(corners(mesh)[3], (Vec3f{5, 0, 0}));
  EXPECT_TRUE(mesh.N.empty());
  EXPECT_TRUE(mesh.uv[0].empty());
}

// The specification's formulas: strip (i, i + 1 + i mod 2, i + 2 − i mod 2), fan (i + 1, i + 2, 0).
TEST(GltfMesh, UnrollsStripsAndFansWithTheirWinding)
{
  const auto normals_up = [](const Mesh& mesh) {
    for (const TriangleIndices& t : mesh.triangles) {
      if (cross(mesh.P[t.v1] - mesh.P[t.v0], mesh.P[t.v2] - mesh.P[t.v0]).z <= 0) {
        return false;
      }
    }
    return true;
  };
  GltfBuilder strip;
  const int zigzag = strip.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}, "VEC3");
  const Mesh a = load_mesh(strip, {{"attributes", {{"POSITION", zigzag}}}, {"mode", 5}});
  EXPECT_EQ(a.triangles.size(), 3u);
  EXPECT_TRUE(normals_up(a));
  GltfBuilder fan;
  const int ring = fan.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, -1, 1, 0}, "VEC3");
  const Mesh f = load_mesh(fan, {{"attributes", {{"POSITION", ring}}}, {"mode", 6}});
  EXPECT_EQ(f.triangles.size(), 3u);
  EXPECT_TRUE(normals_up(f));
}

TEST(GltfMesh, StitchedStripsGiveNoWarning)
{
  GltfBuilder b = test::square_scene();
  const int indices = b.accessor<std::uint16_t>({0, 1, 3, 2, 2, 0, 0, 1, 3}, "SCALAR");
  b.json["meshes"][0]["primitives"][0]["indices"] = indices;
  b.json["meshes"][0]["primitives"][0]["mode"] = 5;
  const Scene scene = load_glb(b);
  EXPECT_FALSE(has_warning(scene, "zero area"));
}

// KHR_mesh_quantization, and the normalization rule f = max(c / max, −1).
TEST(GltfMesh, ConvertsEveryComponentType)
{
  const auto first_corner = [](auto value, bool normalized) {
    using T = decltype(value);
    GltfBuilder b;
    const int P = b.accessor<T>({value, 0, 0, 100, 0, 0, 0, 100, 0}, "VEC3", normalized);
    return load_mesh(b, {{"attributes", {{"POSITION", P}}}}).P[0].x;
  };
  EXPECT_EQ(first_corner(std::int8_t{-128}, false), -128.0f);
  EXPECT_EQ(first_corner(std::int8_t{-128}, true), -1.0f);
  EXPECT_EQ(first_corner(std::int8_t{127}, true), 1.0f);
  EXPECT_EQ(first_corner(std::uint8_t{51}, true), 51.0f / 255.0f);
  EXPECT_EQ(first_corner(std::int16_t{-32768}, true), -1.0f);
  EXPECT_EQ(first_corner(std::int16_t{-5}, false), -5.0f);
  EXPECT_EQ(first_corner(std::uint16_t{65535}, true), 1.0f);
  EXPECT_EQ(first_corner(std::uint16_t{65535}, false), 65535.0f);
  EXPECT_EQ(first_corner(0.25f, false), 0.25f);
}

TEST(GltfMesh, FollowsStridesAndOffsets)
{
  GltfBuilder b;
  // position, then a normal, interleaved 24 bytes apart, after 8 bytes of something else
  const int view = b.view<float>({9, 9, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1}, 24);
  for (const std::size_t offset : {8, 20}) {
    b.push("accessors",
           {{"bufferView", view}, {"byteOffset", offset}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
  }
  const Mesh mesh = load_mesh(b, {{"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}});
  EXPECT_EQ(mesh.P[1], (Vec3f{1, 0, 0}));
  EXPECT_EQ(mesh.P[2], (Vec3f{0, 1, 0}));
  EXPECT_EQ(as_vector(mesh.N[2]), (Vec3f{0, 0, 1}));
}

TEST(GltfMesh, ReplacesSparseElements)
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int at = b.view<std::uint8_t>({0, 2}), values = b.view<float>({-1, -1, 0, 7, 8, 9});
  b.json["accessors"][0]["sparse"] = {
      {"count", 2}, {"indices", {{"bufferView", at}, {"componentType", 5121}}}, {"values", {{"bufferView", values}}}};
  const Mesh mesh = load_mesh(b, {{"attributes", {{"POSITION", P}}}});
  EXPECT_EQ(mesh.P[0], (Vec3f{-1, -1, 0}));
  EXPECT_EQ(mesh.P[1], (Vec3f{1, 0, 0}));
  EXPECT_EQ(mesh.P[2], (Vec3f{7, 8, 9}));
}

TEST(GltfMesh, ReadsColoursOfThreeAndFourComponents)
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int rgb = b.accessor<std::uint8_t>({255, 0, 51, 0, 0, 0, 0, 0, 0}, "VEC3", true);
  const Mesh mesh = load_mesh(b, {{"attributes", {{"POSITION", P}, {"COLOR_0", rgb}}}});
  EXPECT_EQ(mesh.color[0].z, 0.2f);
  EXPECT_EQ(mesh.color[0].w, 1.0f);
  GltfBuilder c;
  const int Q = c.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int rgba = c.accessor<float>({1, 1, 1, 0.5f, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC4");
  EXPECT_EQ(load_mesh(c, {{"attributes", {{"POSITION", Q}, {"COLOR_0", rgba}}}}).color[0].w, 0.5f);
}

// A needle of tiny but real area stays; collinear and collapsed triangles go, and are counted.
TEST(GltfMesh, DropsOnlyTrianglesWithoutArea)
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 2, 0, 0, 1, 1e-30f, 0}, "VEC3");
  const int indices = b.accessor<std::uint16_t>({0, 1, 2, 0, 2, 3, 1, 1, 3}, "SCALAR");
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", P}}}, {"indices", indices}})}});
  const Scene scene = load_glb(b);
  EXPECT_EQ(scene.meshes.at(0).triangles.size(), 1u);
  EXPECT_TRUE(has_warning(scene, "2 triangles of zero area"));
}

TEST(GltfMesh, MakesNormalsUnitAndReplacesZeroOnes)
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int N = b.accessor<float>({0, 0, 0, 0, 3, 4, 1e-30f, 0, 0}, "VEC3");
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", P}, {"NORMAL", N}}}})}});
  const Scene scene = load_glb(b);
  const Mesh& mesh = scene.meshes.at(0);
  EXPECT_EQ(as_vector(mesh.N[0]), (Vec3f{0, 0, 1}));  // the triangle's own
  expect_near(as_vector(mesh.N[1]), {0, 0.6f, 0.8f}, 1e-7f);
  expect_near(as_vector(mesh.N[2]), {1, 0, 0}, 1e-7f);
  EXPECT_TRUE(has_warning(scene, "1 zero normals"));
}

TEST(GltfMesh, PrimitivesThatShareAnAccessorKeepTheirPartOnly)
{
  GltfBuilder b;
  std::vector<float> positions;
  for (int i = 0; i < 300; ++i) {
    positions.insert(positions.end(), {static_cast<float>(i), static_cast<float>(i % 2), static_cast<float>(i % 3)});
  }
  const int P = b.accessor(positions, "VEC3");
  const int indices = b.accessor<std::uint16_t>({200, 201, 202}, "SCALAR");
  const Mesh mesh = load_mesh(b, {{"attributes", {{"POSITION", P}}}, {"indices", indices}});
  EXPECT_EQ(mesh.P.size(), 3u);
  EXPECT_EQ(mesh.P[0].x, 200.0f);
}

TEST(GltfMesh, SkipsPointsAndLinesWithAWarning)
{
  GltfBuilder b;
  const int P = b.accessor(kSquare, "VEC3");
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", P}}}, {"mode", 1}})}});
  const Scene scene = load_glb(b);
  EXPECT_TRUE(scene.meshes.empty());
  EXPECT_TRUE(has_warning(scene, "points and lines"));
  EXPECT_TRUE(has_warning(scene, "nothing to render"));
}

TEST(GltfMesh, ViewAndBytesMatchTheVectors)
{
  GltfBuilder b = test::square_scene();
  const Scene scene = load_glb(b);
  const Mesh& mesh = scene.meshes.at(0);
  const MeshView view = mesh.view();
  EXPECT_EQ(view.P, mesh.P.data());
  EXPECT_EQ(view.color, nullptr);
  EXPECT_EQ(view.num_vertices, 4u);
  EXPECT_EQ(view.num_triangles, 2u);
  EXPECT_GE(mesh.bytes(), 4 * (12 + 12 + 8) + 2 * 12u);
}

// --- tangents ---

/// The square with a material that has a normal map.
GltfBuilder normal_mapped_square()
{
  GltfBuilder b = test::square_scene();
  b.json["images"] = {{{"uri", test::kPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {{{"normalTexture", {{"index", 0}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

TEST(Tangents, AreMadeForNormalMapsOnly)
{
  EXPECT_TRUE(load_glb(test::square_scene()).meshes.at(0).tangent.empty());
  EXPECT_EQ(load_glb(normal_mapped_square()).meshes.at(0).tangent.size(), 4u);
}

// u runs along +x, and v down the square: the bitangent w · N × T must point up.
TEST(Tangents, OfAnUprightSquareAreRightAndUp)
{
  const Mesh mesh = load_glb(normal_mapped_square()).meshes.at(0);
  for (std::size_t v = 0; v < 4; ++v) {
    expect_near(xyz(mesh.tangent[v]), {1, 0, 0}, 1e-6f);
    const Vec3f bitangent = cross(as_vector(mesh.N[v]), xyz(mesh.tangent[v])) * mesh.tangent[v].w;
    expect_near(bitangent, {0, 1, 0}, 1e-6f);
  }
}

TEST(Tangents, GivenOnesAreKeptAndMadeUnit)
{
  GltfBuilder b = normal_mapped_square();
  const int T = b.accessor<float>({0, 2, 0, -1, 0, 2, 0, -1, 0, 2, 0, -1, 0, 2, 0, 1}, "VEC4");
  b.json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = T;
  const Mesh mesh = load_glb(b).meshes.at(0);
  expect_near(xyz(mesh.tangent[0]), {0, 1, 0}, 1e-6f);
  EXPECT_EQ(mesh.tangent[0].w, -1.0f);
  EXPECT_EQ(mesh.tangent[3].w, 1.0f);
}

// Two triangles share an edge, one has mirrored uv: the two shared vertices are doubled.
TEST(Tangents, MirroredUvSplitVertices)
{
  GltfBuilder b = normal_mapped_square();
  const int uv = b.accessor<float>({0, 1, 1, 1, 1, 0, 1, 1}, "VEC2");  // vertex 3 takes vertex 1's place: mirrored
  b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uv;
  const Mesh mesh = load_glb(b).meshes.at(0);
  EXPECT_EQ(mesh.P.size(), 6u);
  EXPECT_EQ(mesh.tangent.size(), 6u);
  EXPECT_EQ(mesh.N.size(), 6u);
  for (const TriangleIndices& t : mesh.triangles) {
    EXPECT_EQ(mesh.tangent[t.v0].w, mesh.tangent[t.v1].w);
    EXPECT_EQ(mesh.tangent[t.v0].w, mesh.tangent[t.v2].w);
  }
  EXPECT_NE(mesh.tangent[mesh.triangles[0].v0].w, mesh.tangent[mesh.triangles[1].v0].w);
}

// As MikkTSpace leaves them: along x, mirrored. What shares a vertex with a triangle that has area takes its.
TEST(Tangents, OfTrianglesWithoutUvAreaRunAlongXMirrored)
{
  GltfBuilder b = normal_mapped_square();
  const auto with = [&](const std::vector<float>& uv) {
    b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = b.accessor<float>(uv, "VEC2");
    return load_glb(b).meshes.at(0);
  };
  const Mesh none = with({.3f, .3f, .3f, .3f, .3f, .3f, .3f, .3f});
  for (const Vec4f tangent : none.tangent) {
    expect_near(xyz(tangent), {1, 0, 0}, 1e-6f);
    EXPECT_EQ(tangent.w, -1.0f);
  }
  // Of the second triangle all uv lie on a line.
  const Mesh half = with({0, 1, 1, 1, 1, 0, .5f, .5f});
  const TriangleIndices second = half.triangles.at(1);
  int num_shared = 0;
  for (const std::uint32_t v : {second.v0, second.v1, second.v2}) num_shared += half.tangent[v].w == 1.0f ? 1 : 0;
  EXPECT_EQ(num_shared, 2);
}

// On a cylinder around y with u once around, ∂P/∂u is the horizontal direction across the radius at every vertex.
TEST(Tangents, OfACylinderFollowTheCircle)
{
  GltfBuilder b;
  constexpr int kColumns = 48;
  std::vector<float> P, N, uv;
  std::vector<std::uint16_t> indices;
  for (int c = 0; c <= kColumns; ++c) {
    for (int r = 0; r < 2; ++r) {
      const float u = static_cast<float>(c) / kColumns, angle = 2 * kPi * u;
      P.insert(P.end(), {std::sin(angle), 1.0f - static_cast<float>(r), std::cos(angle)});
      N.insert(N.end(), {std::sin(angle), 0.0f, std::cos(angle)});
      uv.insert(uv.end(), {u, static_cast<float>(r)});
      if (c < kColumns && r == 0) {
        const auto k = static_cast<std::uint16_t>(2 * c);
        for (const int offset : {0, 1, 2, 1, 3, 2}) {
          indices.push_back(static_cast<std::uint16_t>(k + offset));
        }
      }
    }
  }
  b.json = normal_mapped_square().json;
  for (const char* array : {"meshes", "nodes", "scenes", "accessors", "bufferViews"}) {
    b.json.erase(array);
  }
  const int p = b.accessor(P, "VEC3"), n = b.accessor(N, "VEC3"), t = b.accessor(uv, "VEC2");
  const int i = b.accessor(indices, "SCALAR");
  const Mesh mesh = load_mesh(
      b, {{"attributes", {{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", t}}}, {"indices", i}, {"material", 0}});
  ASSERT_EQ(mesh.P.size(), P.size() / 3);
  for (std::size_t v = 0; v < mesh.P.size(); ++v) {
    const Vec3f along{mesh.P[v].z, 0, -mesh.P[v].x};
    // Columns are 7.5° apart; a vertex averages its two sides, at the seam it has one, which projection straightens.
    EXPECT_GT(dot(xyz(mesh.tangent[v]), along), 0.9999f) << v;
    const Vec3f up = cross(as_vector(mesh.N[v]), xyz(mesh.tangent[v])) * mesh.tangent[v].w;
    EXPECT_GT(up.y, 0.9999f);
  }
}

TEST(Tangents, FlatMeshesGetVerticesOfTheirOwn)
{
  GltfBuilder b = normal_mapped_square();
  b.json["meshes"][0]["primitives"][0]["attributes"].erase("NORMAL");
  const Mesh mesh = load_glb(b).meshes.at(0);
  EXPECT_TRUE(mesh.N.empty());
  EXPECT_EQ(mesh.P.size(), 6u);
  EXPECT_EQ(mesh.tangent.size(), 6u);
}

TEST(Tangents, OfUvWithoutAreaAreStillUnitAndAcross)
{
  GltfBuilder b = normal_mapped_square();
  const int uv = b.accessor<float>({0, 0, 0, 0, 0, 0, 0, 0}, "VEC2");
  b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uv;
  const Mesh mesh = load_glb(b).meshes.at(0);
  for (std::size_t v = 0; v < mesh.P.size(); ++v) {
    EXPECT_NEAR(length(xyz(mesh.tangent[v])), 1.0f, 1e-6f);
    EXPECT_NEAR(dot(xyz(mesh.tangent[v]), as_vector(mesh.N[v])), 0.0f, 1e-6f);
  }
}

}  // namespace
}  // namespace relief
