#include "scene/scene.h"

namespace relief {
namespace {

template <typename T>
const T* data_or_null(const std::vector<T>& v)
{
  return v.empty() ? nullptr : v.data();
}

template <typename T>
std::size_t vector_bytes(const std::vector<T>& v)
{
  return v.capacity() * sizeof(T);
}

}  // namespace

MeshView Mesh::view() const
{
  MeshView m;
  m.P = data_or_null(P);
  m.N = data_or_null(N);
  m.uv[0] = data_or_null(uv[0]);
  m.uv[1] = data_or_null(uv[1]);
  m.tangent = data_or_null(tangent);
  m.color = data_or_null(color);
  m.generated = data_or_null(generated);
  m.radius = data_or_null(radius);
  m.triangles = data_or_null(triangles);
  m.num_vertices = static_cast<std::uint32_t>(P.size());
  m.num_triangles = static_cast<std::uint32_t>(triangles.size());
  return m;
}

std::size_t Mesh::bytes() const
{
  std::size_t of_columns = 0;
  for (const AttributeColumn& column : columns) of_columns += vector_bytes(column.values);
  for (const MeshStep& step : steps) of_columns += vector_bytes(step.P) + vector_bytes(step.N);
  return of_columns + vector_bytes(P) + vector_bytes(N) + vector_bytes(uv[0]) + vector_bytes(uv[1]) +
         vector_bytes(tangent) + vector_bytes(color) + vector_bytes(generated) + vector_bytes(triangles) +
         vector_bytes(radius);
}

}  // namespace relief
