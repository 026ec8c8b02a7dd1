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

/// Eight words side by side: the same arithmetic, one lane a word.
using UintX8 = std::uint32_t __attribute__((vector_size(32)));

RELIEF_KERNEL constexpr std::uint32_t swap_bytes(std::uint32_t v) { return __builtin_bswap32(v); }
RELIEF_KERNEL UintX8 swap_bytes(UintX8 v)
{
  using Bytes = unsigned char __attribute__((vector_size(32)));
  const Bytes bytes = __builtin_bit_cast(Bytes, v);
  return __builtin_bit_cast(
      UintX8, __builtin_shufflevector(bytes, bytes, 3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12, 19, 18, 17,
                                      16, 23, 22, 21, 20, 27, 26, 25, 24, 31, 30, 29, 28));
}

template <class Uint>
RELIEF_KERNEL constexpr Uint reverse_bits(Uint v)
{
  v = ((v >> 1) & 0x55555555u) | ((v & 0x55555555u) << 1);
  v = ((v >> 2) & 0x33333333u) | ((v & 0x33333333u) << 2);
  v = ((v >> 4) & 0x0f0f0f0fu) | ((v & 0x0f0f0f0fu) << 4);
  return swap_bytes(v);
}

#ifdef __AVX2__
/// The same with a table of the sixteen half bytes: half as many instructions.
RELIEF_KERNEL UintX8 reverse_bits(UintX8 v)
{
  using Bytes = char __attribute__((vector_size(32)));
  constexpr Bytes kReversed = {0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15,
                               0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15};
  const UintX8 swapped = swap_bytes(v);
  const Bytes low = __builtin_bit_cast(Bytes, swapped & 0x0f0f0f0fu);
  const Bytes high = __builtin_bit_cast(Bytes, (swapped >> 4) & 0x0f0f0f0fu);
  return __builtin_bit_cast(UintX8, __builtin_ia32_pshufb256(kReversed, low)) << 4 |
         __builtin_bit_cast(UintX8, __builtin_ia32_pshufb256(kReversed, high));
}
#endif

/// Permutation in which each output bit depends on the input bits at and below it only: nested uniform scrambling of a
/// number whose digits are stored least significant first.
/// @param v     digits after the binary point, first digit in bit 0
/// @param seed  chooses the permutation
/// @source Vegdahl 2021
template <class Uint>
RELIEF_KERNEL constexpr Uint owen_permute_reversed(Uint v, Uint seed)
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
template <class Uint>
RELIEF_KERNEL constexpr Uint sobol_dimension1_reversed(Uint index)
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

/// Mixes 32 bits well; a bijection.
/// @source Wellons 2018, "Prospecting for Hash Functions" (lowbias32)
template <class Uint>
RELIEF_KERNEL constexpr Uint hash_mix_32(Uint v)
{
  v = (v ^ (v >> 16)) * 0x7feb352du;
  v = (v ^ (v >> 15)) * 0x846ca68bu;
  return v ^ (v >> 16);
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

/// log₂ of the length of a stream for a number of samples a pixel that is to be even, see sample_sequence_index.
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
/// are, and their number is a power of two, halves and whole are nets too. Samples past the four streams double them, again
/// and again: the next 2^k of the sequence have four streams of their own. So the whole is a net whenever 2^k samples are
/// done, and halves are made of nets, where nobody knows how many samples there will be. (With streams for the most that
/// there may be, the variance at 64 of 4,096 samples was twice what it is, in smooth light twelve times.)
/// @param log2_stream  from sample_log2_stream
RELIEF_KERNEL constexpr std::uint32_t sample_sequence_index(std::uint32_t sample, std::uint32_t log2_stream)
{
  std::uint32_t done = 0;
  if (sample >> log2_stream >= 4) {
    const std::uint32_t log2 = 31u - static_cast<std::uint32_t>(__builtin_clz(sample));
    done = 1u << log2;
    log2_stream = log2 - 2;
    sample -= done;
  }
  return done | (sample >> 2) | ((sample >> 1 & 1u) << log2_stream) | ((sample & 1u) << (log2_stream + 1));
}

/// Whether the sample with an index in the sequence is even-numbered: of a pixel's first half.
RELIEF_KERNEL constexpr bool sample_is_even(std::uint32_t sample_index, std::uint32_t log2_stream)
{
  if (sample_index >> log2_stream >= 4) log2_stream = 29u - static_cast<std::uint32_t>(__builtin_clz(sample_index));
  return (sample_index >> (log2_stream + 1) & 1u) == 0;
}

/// Key that scrambles one number of a dimension.
/// @param column  twice the dimension, plus one for the second number of a pair
template <class Uint>
RELIEF_KERNEL constexpr Uint sample_scramble_key(std::uint32_t pixel_hash, Uint column)
{
  return hash_mix_32(column * 0x9e3779b1u + pixel_hash);
}

/// Place in the Sobol sequence at which a dimension takes a sample.
/// Shuffling by nested scrambling keeps aligned blocks of 2^k indices together, so prefixes stay stratified.
template <class Uint>
RELIEF_KERNEL constexpr Uint sample_shuffled_index(std::uint32_t pixel_hash, std::uint32_t sample_index, Uint dimension)
{
  const Uint seed = hash_mix_32(dimension * 0x85ebca6bu + ~pixel_hash);
  return reverse_bits(owen_permute_reversed(Uint{} + reverse_bits(sample_index), seed));
}

/// One stratified number.
/// @param pixel_hash    from sample_pixel_hash
/// @param sample_index  place in the sequence, see sample_sequence_index
/// @param dimension     see dimensions.h; numbers of different dimensions are independent
/// @return              [0, 1)
RELIEF_KERNEL constexpr float sample_1d(std::uint32_t pixel_hash, std::uint32_t sample_index, std::uint32_t dimension)
{
  const std::uint32_t index = sample_shuffled_index(pixel_hash, sample_index, dimension);
  return unit_float(reverse_bits(owen_permute_reversed(index, sample_scramble_key(pixel_hash, 2 * dimension))));
}

/// One point of a scrambled (0,2)-sequence: stratified in x, in y and jointly.
/// @return [0, 1)²
RELIEF_KERNEL constexpr Vec2f sample_2d(std::uint32_t pixel_hash, std::uint32_t sample_index, std::uint32_t dimension)
{
  const std::uint32_t index = sample_shuffled_index(pixel_hash, sample_index, dimension);
  const std::uint32_t x = owen_permute_reversed(index, sample_scramble_key(pixel_hash, 2 * dimension));
  const std::uint32_t y =
      owen_permute_reversed(sobol_dimension1_reversed(index), sample_scramble_key(pixel_hash, 2 * dimension + 1));
  return {unit_float(reverse_bits(x)), unit_float(reverse_bits(y))};
}

/// Points of four dimensions at once.
struct Sample2dX4 {
  Vec2f at[4];
  std::uint32_t first_bits[2];  ///< all bits of the first dimension's numbers, which floats hold 24 of
};

/// The points that sample_2d has for four dimensions in a row, for little more than what one of them costs: what a
/// surface needs is thrown together.
/// @param dimension  the first
RELIEF_KERNEL Sample2dX4 sample_2d_x4(std::uint32_t pixel_hash, std::uint32_t sample_index, std::uint32_t dimension)
{
  constexpr UintX8 kColumns = {0, 1, 2, 3, 4, 5, 6, 7};
  constexpr UintX8 kDimensions = {0, 0, 1, 1, 2, 2, 3, 3};
  constexpr UintX8 kSecond = {0, ~0u, 0, ~0u, 0, ~0u, 0, ~0u};
  const UintX8 index = sample_shuffled_index(pixel_hash, sample_index, kDimensions + dimension);
  const UintX8 digits = index ^ ((index ^ sobol_dimension1_reversed(index)) & kSecond);
  const UintX8 bits =
      reverse_bits(owen_permute_reversed(digits, sample_scramble_key(pixel_hash, kColumns + 2 * dimension)));
  using IntX8 = std::int32_t __attribute__((vector_size(32)));
  using FloatX8 = float __attribute__((vector_size(32)));
  // 24 bits, as unit_float; signed, because that is what machines convert.
  const FloatX8 u = __builtin_convertvector(__builtin_bit_cast(IntX8, bits >> 8), FloatX8) * 0x1p-24f;
  return {{{u[0], u[1]}, {u[2], u[3]}, {u[4], u[5]}, {u[6], u[7]}}, {bits[0], bits[1]}};
}

}  // namespace relief
