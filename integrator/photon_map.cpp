#include "integrator/photon_map.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <utility>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "kernel/sample/sobol.h"

namespace relief {

namespace {

/// Number of the first photon of every chunk; the last entry is their sum.
std::vector<std::size_t> chunk_offsets(const std::vector<std::vector<Photon>>& chunks)
{
  std::vector<std::size_t> first(chunks.size() + 1, 0);
  for (std::size_t c = 0; c < chunks.size(); ++c) first[c + 1] = first[c] + chunks[c].size();
  return first;
}

}  // namespace

void PhotonMap::build(const std::vector<std::vector<Photon>>& chunks, const std::vector<float>& radii)
{
  const std::vector<std::size_t> first = chunk_offsets(chunks);
  const std::size_t count = first.back();
  const std::uint32_t num_buckets = std::bit_ceil(static_cast<std::uint32_t>(std::max<std::size_t>(count, 2)));
  largest_radius_ = count > 0 ? *std::max_element(radii.begin(), radii.end()) : 0.0f;
  const float least_inverse = 1.0f / sqr(largest_radius_);

  order_.resize(count);
  std::vector<const Photon*> photons(count);
  std::vector<std::array<Box3, kPhotonOctaves>> bounds(chunks.size());
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    bounds[c].fill(box_empty());
    for (std::size_t k = 0; k < chunks[c].size(); ++k) {
      const Photon& photon = chunks[c][k];
      const std::size_t i = first[c] + k;
      const int octave = photon_octave(1.0f / sqr(radii[i]), least_inverse);
      Box3& box = bounds[c][static_cast<std::size_t>(octave)];
      box = box_union(box, {photon.P, photon.P});
      const float inverse_cell = 0.5f / std::ldexp(largest_radius_, -octave);
      const std::uint32_t row =
          photon_row(photon_cell(photon.P.y, inverse_cell), photon_cell(photon.P.z, inverse_cell), octave);
      const std::uint32_t bucket =
          (row + static_cast<std::uint32_t>(photon_cell(photon.P.x, inverse_cell))) & (num_buckets - 1);
      order_[i] = static_cast<std::uint64_t>(bucket) << 32 | i;
      photons[i] = &photon;
    }
  });
  bounds_.fill(box_empty());
  octaves_ = 0;
  for (const auto& of_chunk : bounds) {
    for (std::size_t octave = 0; octave < kPhotonOctaves; ++octave) {
      bounds_[octave] = box_union(bounds_[octave], of_chunk[octave]);
      if (bounds_[octave].low.x <= bounds_[octave].high.x) octaves_ |= 1u << octave;
    }
  }
  tbb::parallel_sort(order_.begin(), order_.end());
  mark_near(photons, radii);

  x_.resize(count);
  y_.resize(count);
  z_.resize(count);
  inverse_radius_squared_.resize(count);
  arrivals_.resize(count);
  bucket_begin_.assign(num_buckets + 1, 0);
  const auto bucket_of = [&](std::size_t i) { return static_cast<std::uint32_t>(order_[i] >> 32); };
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    const std::size_t from = order_[i] & 0xffffffffu;
    const Photon& photon = *photons[from];
    x_[i] = photon.P.x;
    y_[i] = photon.P.y;
    z_[i] = photon.P.z;
    inverse_radius_squared_[i] = 1.0f / sqr(radii[from]);
    arrivals_[i] = photon.arrival;
    // The first photon of a bucket also begins the empty ones before it.
    const std::uint32_t begin = i == 0 ? 0 : bucket_of(i - 1) + 1;
    for (std::uint32_t b = begin; b <= bucket_of(i); ++b) bucket_begin_[b] = static_cast<std::uint32_t>(i);
  });
  for (std::uint32_t b = count > 0 ? bucket_of(count - 1) + 1 : 0; b <= num_buckets; ++b) {
    bucket_begin_[b] = static_cast<std::uint32_t>(count);
  }
}

void PhotonMap::mark_near(const std::vector<const Photon*>& photons, const std::vector<float>& radii)
{
  // A photon's ball reaches into three cells an axis at most. A table of a byte a photon: where they lie dense many share a cell, so
  // that few entries are taken, and few cells share one.
  constexpr std::uint32_t kFewest = 64;
  near_.assign(std::max(kFewest, std::bit_ceil(static_cast<std::uint32_t>(photons.size()))), 0);
  const auto mask = static_cast<std::uint32_t>(near_.size()) - 1;
  const float least_inverse = 1.0f / sqr(largest_radius_), inverse_cell = 1.0f / largest_radius_;
  tbb::parallel_for(std::size_t{0}, photons.size(), [&](std::size_t i) {
    const auto bit = static_cast<std::uint8_t>(1u << photon_octave(1.0f / sqr(radii[i]), least_inverse));
    // A little more, for the rounding of distances and cells.
    const Vec3f P = photons[i]->P;
    const Vec3f reach = splat3(1.001f * radii[i]) + 1e-6f * abs(P);
    const auto cells = [&](float x, float r) {
      return std::pair{photon_cell(x - r, inverse_cell), photon_cell(x + r, inverse_cell)};
    };
    const auto [x0, x1] = cells(P.x, reach.x);
    const auto [y0, y1] = cells(P.y, reach.y);
    const auto [z0, z1] = cells(P.z, reach.z);
    for (std::int32_t z = z0; z <= z1; ++z) {
      for (std::int32_t y = y0; y <= y1; ++y) {
        for (std::int32_t x = x0; x <= x1; ++x) {
          const std::atomic_ref<std::uint8_t> entry(near_[photon_near(x, y, z, mask)]);
          if ((entry.load(std::memory_order_relaxed) & bit) == 0) entry.fetch_or(bit, std::memory_order_relaxed);
        }
      }
    }
  });
}

PhotonMapView PhotonMap::view() const
{
  PhotonMapView v;
  if (arrivals_.empty()) return v;
  v.x = x_.data();
  v.y = y_.data();
  v.z = z_.data();
  v.inverse_radius_squared = inverse_radius_squared_.data();
  v.arrivals = arrivals_.data();
  v.bucket_begin = bucket_begin_.data();
  v.bucket_mask = static_cast<std::uint32_t>(bucket_begin_.size()) - 2;
  v.largest_radius = largest_radius_;
  v.bounds = bounds_.data();
  v.octaves = octaves_;
  v.near = near_.data();
  v.near_mask = static_cast<std::uint32_t>(near_.size()) - 1;
  return v;
}

std::size_t PhotonMap::bytes() const
{
  return arrivals_.capacity() * (sizeof(PhotonArrival) + 4 * sizeof(float)) +
         bucket_begin_.capacity() * sizeof(std::uint32_t) + order_.capacity() * sizeof(std::uint64_t) +
         near_.capacity();
}

float photon_radius_for(const std::vector<std::vector<Photon>>& chunks, double wanted, PhotonPlaces places)
{
  const std::vector<std::size_t> first = chunk_offsets(chunks);
  const std::size_t count = first.back();
  // Every stride-th photon is searched, so that a tenth of what is wanted is still a number to rely on.
  constexpr std::size_t kSearched = 32768;
  constexpr std::size_t kQueries = 256;
  const std::size_t stride = std::max<std::size_t>(1, count / kSearched);
  std::vector<Vec3f> points;
  for (const std::vector<Photon>& chunk : chunks) {
    for (const Photon& photon : chunk) points.push_back(photon.P);
  }
  std::vector<Vec3f> searched;
  for (std::size_t i = 0; i < count; i += stride) searched.push_back(points[i]);
  if (count < 2) return 0;
  // Of few photons, half: a radius beyond what they cover would say nothing of how dense they lie.
  wanted = std::min(wanted, static_cast<double>(count) / 2);
  const double nth = std::min(std::max(4.0, wanted / static_cast<double>(stride)), std::floor(wanted));

  std::vector<float> radii(std::min(kQueries, searched.size()));
  tbb::parallel_for(std::size_t{0}, radii.size(), [&](std::size_t q) {
    const std::size_t at = q * searched.size() / radii.size();
    std::vector<float> squared(searched.size());
    for (std::size_t i = 0; i < searched.size(); ++i) squared[i] = length_squared(searched[i] - searched[at]);
    const auto place = squared.begin() + static_cast<std::ptrdiff_t>(nth);
    std::nth_element(squared.begin(), place, squared.end());
    radii[q] = std::sqrt(*place);
  });
  double sum = 0;
  int apart = 0;
  for (const float radius : radii) {
    if (!(radius > 0)) continue;
    sum += std::log(static_cast<double>(radius));
    ++apart;
  }
  if (apart == 0) return 0;
  // On a surface, photons within a radius grow with its square; in a medium with its cube.
  const double found = nth * static_cast<double>(stride);
  return static_cast<float>(std::exp(sum / apart) * std::pow(wanted / found, 1.0 / static_cast<int>(places)));
}

std::vector<float> photon_radii(const std::vector<std::vector<Photon>>& chunks,
                                double wanted,
                                float typical,
                                std::uint32_t shift,
                                PhotonPlaces places)
{
  constexpr float kWidest = 4;
  constexpr std::size_t kSizes = 8;  // of cells, from twice the widest radius down by halves
  const std::vector<std::size_t> first = chunk_offsets(chunks);
  const std::size_t count = first.back();
  wanted = std::min(wanted, static_cast<double>(count) / 2);
  const double enough = std::max(2.0, wanted / 2);  // a photon alone says nothing
  const float widest = kWidest * typical;
  const auto cell_size = [&](std::size_t size) { return std::ldexp(2 * widest, -static_cast<int>(size)); };
  const Vec2f u = sample_2d(shift, 0, 0), v = sample_2d(shift, 0, 1);
  const Vec3f offset = cell_size(0) * Vec3f{u.x, u.y, v.x};

  // Cells that share a counter only matter where they are nearly empty, and such are not asked in the end.
  const std::size_t mask = std::bit_ceil(std::max<std::size_t>(count / 2, 64)) - 1;
  const auto counter = [&](Vec3f P, std::size_t size) {
    const float inverse = 1.0f / cell_size(size);
    const Vec3f Q = P + offset;
    return (photon_row(photon_cell(Q.y, inverse), photon_cell(Q.z, inverse), static_cast<int>(size)) +
            static_cast<std::uint32_t>(photon_cell(Q.x, inverse))) &
           mask;
  };
  std::array<std::vector<std::uint32_t>, kSizes> counts;
  tbb::parallel_for(std::size_t{0}, kSizes, [&](std::size_t size) {
    counts[size].assign(mask + 1, 0);
    for (const std::vector<Photon>& chunk : chunks) {
      for (const Photon& photon : chunk) ++counts[size][counter(photon.P, size)];
    }
  });

  std::vector<float> radii(count);
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    for (std::size_t k = 0; k < chunks[c].size(); ++k) {
      std::size_t size = kSizes;
      double found = 0;
      do {
        --size;
        found = counts[size][counter(chunks[c][k].P, size)];
      } while (size > 0 && found < enough);
      const auto side = static_cast<double>(cell_size(size));
      const double share = wanted / found / 3.14159265358979;
      const double radius =
          places == PhotonPlaces::kSurfaces ? side * std::sqrt(share) : side * std::cbrt(0.75 * share);
      radii[first[c] + k] = std::min(widest, static_cast<float>(radius));
    }
  });
  return radii;
}

}  // namespace relief
