// Random numbers: Owen-scrambled Sobol points as a pure function of (pixel, sample, dimension), so that nothing depends
// on thread count or order.
//
// Every dimension (a pair for sample_2d) is its own copy of the (0,2)-sequence of Sobol's first two dimensions: scrambled
// by its own hash and visited in its own shuffled order ("padding"), so pairs are stratified and different pairs are
// independent. A pixel's samples visit the sequence in four interleaved streams (sample_sequence_index): its halves and
// quarters are stratified by themselves, so that their differences show how fast the error falls, and together they fill
// one larger stratified set.
//
// Sources: Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4); Laine and Karras 2011, "Stratified Sampling for
// Stochastic Transparency", §3.2; permutation: Vegdahl 2021, "Building a Better LK Hash".
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Reverses the bits of both halves of a pair at once.
/// @param v  two words, as low and high half
/// @return   the reversed low word in the high half, and the reverse
RELIEF_KERNEL constexpr std::uint64_t reverse_bits_pair(std::uint64_t v)
{
  v = ((v >> 1) & 0x5555555555555555u) | ((v & 0x5555555555555555u) << 1);
  v = ((v >> 2) & 0x3333333333333333u) | ((v & 0x3333333333333333u) << 2);
  v = ((v >> 4) & 0x0f0f0f0f0f0f0f0fu) | ((v & 0x0f0f0f0f0f0f0f0fu) << 4);
  return __builtin_bswap64(v);
}

RELIEF_KERNEL constexpr std::uint32_t reverse_bits(std::uint32_t v)
{
  v = ((v >> 1) & 0x55555555u) | ((v & 0x55555555u) << 1);
  v = ((v >> 2) & 0x33333333u) | ((v & 0x33333333u) << 2);
  v = ((v >> 4) & 0x0f0f0f0fu) | ((v & 0x0f0f0f0fu) << 4);
  return __builtin_bswap32(v);
}

/// Permutation in which each output bit depends on the input bits at and below it only: nested uniform scrambling of a
/// number whose digits are stored least significant first.
/// @param v     digits after the binary point, first digit in bit 0
/// @param seed  chooses the permutation
/// @source Vegdahl 2021
RELIEF_KERNEL constexpr std::uint32_t owen_permute_reversed(std::uint32_t v, std::uint32_t seed)
{
  v ^= v * 0x3d20adeau;
  v += seed;
  v *= (seed >> 16) | 1u;
  v ^= v * 0x05526c56u;
  v ^= v * 0x53a22864u;
  return v;
}

/// Second dimension of the Sobol sequence, digits least significant first (bit 0 is ½).
/// Its generator matrix is Pascal's triangle mod 2: digit j is the parity of the index bits k with C(k, j) odd, which by
/// Lucas' theorem are those whose position contains the bits of j: a superset sum over the five bits of a position.
RELIEF_KERNEL constexpr std::uint32_t sobol_dimension1_reversed(std::uint32_t index)
{
  index ^= (index >> 16) & 0x0000ffffu;
  index ^= (index >> 8) & 0x00ff00ffu;
  index ^= (index >> 4) & 0x0f0f0f0fu;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 1) & 0x55555555u;
  return index;
}

/// Mixes 64 bits well; a bijection.
/// @source Steele et al. 2014, SplitMix64's finalizer with Stafford's variant 13 constants
RELIEF_KERNEL constexpr std::uint64_t hash_mix(std::uint64_t v)
{
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

/// Number in [0, 1) from the upper 24 bits: the most that a float holds evenly spaced.
RELIEF_KERNEL constexpr float unit_float(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

/// Everything that distinguishes a pixel's random numbers from its neighbours'.
/// @param seed  of the render
/// @param x, y  pixel of the *whole* image, so that a crop has the same numbers
RELIEF_KERNEL constexpr std::uint32_t sample_pixel_hash(std::uint64_t seed, int x, int y)
{
  const std::uint64_t pixel =
      (static_cast<std::uint64_t>(static_cast<std::uint32_t>(y)) << 32) | static_cast<std::uint32_t>(x);
  return static_cast<std::uint32_t>(hash_mix(hash_mix(seed + 0x9e3779b97f4a7c15u) ^ pixel) >> 32);
}

/// log₂ of the length of a stream for a planned number of samples a pixel, see sample_sequence_index.
RELIEF_KERNEL constexpr std::uint32_t sample_log2_stream(std::uint32_t num_samples)
{
  std::uint32_t log2 = 0;
  while ((std::uint64_t{4} << log2) < num_samples) ++log2;
  return log2;
}

/// Index in the sequence of the i-th sample of a pixel.
///
/// Four aligned blocks of the sequence ("streams") are visited in turn: sample i belongs to half i & 1 and, in it, to
/// quarter (i >> 1) & 1. Whenever 4·2^k samples are done, each stream is a net of 2^k points; when all planned samples
/// are, and their number is a power of two, halves and whole are nets too.
/// @param sample       i, below 4·2^log2_stream
/// @param log2_stream  from sample_log2_stream
RELIEF_KERNEL constexpr std::uint32_t sample_sequence_index(std::uint32_t sample, std::uint32_t log2_stream)
{
  return (sample >> 2) | ((sample >> 1 & 1u) << log2_stream) | ((sample & 1u) << (log2_stream + 1));
}

/// Scrambling keys of one (pixel, dimension) and the shuffled index of one sample in it.
struct SampleKeys {
  std::uint32_t index = 0;  ///< position in the Sobol sequence
  std::uint32_t seed_x = 0, seed_y = 0;
};

/// @param dimension  see dimensions.h
RELIEF_KERNEL constexpr SampleKeys sample_keys(std::uint32_t pixel_hash,
                                               std::uint32_t sample_index,
                                               std::uint32_t dimension)
{
  const std::uint64_t key = hash_mix((static_cast<std::uint64_t>(dimension) << 32) | pixel_hash);
  const std::uint32_t seed_x = static_cast<std::uint32_t>(key);
  const std::uint32_t seed_y = static_cast<std::uint32_t>(key >> 32);
  const std::uint32_t seed_index = (seed_x ^ (seed_y << 13 | seed_y >> 19)) * 0x9e3779b1u;
  // Shuffling by nested scrambling keeps aligned blocks of 2^k indices together, so prefixes stay stratified.
  const std::uint32_t index = reverse_bits(owen_permute_reversed(reverse_bits(sample_index), seed_index));
  return {index, seed_x, seed_y};
}

/// One stratified number.
/// @param pixel_hash    from sample_pixel_hash
/// @param sample_index  place in the sequence, see sample_sequence_index
/// @param dimension     see dimensions.h; numbers of different dimensions are independent
/// @return              [0, 1)
RELIEF_KERNEL constexpr float sample_1d(std::uint32_t pixel_hash, std::uint32_t sample_index, std::uint32_t dimension)
{
  const SampleKeys keys = sample_keys(pixel_hash, sample_index, dimension);
  return unit_float(reverse_bits(owen_permute_reversed(keys.index, keys.seed_x)));
}

/// One point of a scrambled (0,2)-sequence: stratified in x, in y and jointly.
/// @return [0, 1)²
/// @cost   about a hundred integer operations, no memory: 12 ns one at a time; in a loop over paths, which compilers turn
///         into SIMD, 4.5 ns with AVX2 and 1.7 ns with AVX-512 (one EPYC core)
RELIEF_KERNEL constexpr Vec2f sample_2d(std::uint32_t pixel_hash, std::uint32_t sample_index, std::uint32_t dimension)
{
  const SampleKeys keys = sample_keys(pixel_hash, sample_index, dimension);
  const std::uint64_t x = owen_permute_reversed(keys.index, keys.seed_x);
  const std::uint64_t y = owen_permute_reversed(sobol_dimension1_reversed(keys.index), keys.seed_y);
  const std::uint64_t both = reverse_bits_pair((x << 32) | y);
  return {unit_float(static_cast<std::uint32_t>(both)), unit_float(static_cast<std::uint32_t>(both >> 32))};
}

}  // namespace relief
