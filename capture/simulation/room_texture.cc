#include "capture/simulation/room_texture.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "core/photo.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

using Uv = Eigen::Vector2f;

uint32_t HashCell(int x, int y, uint32_t seed) {
  uint32_t h = seed * 0x9e3779b9u + static_cast<uint32_t>(x) * 0x85ebca6bu +
               static_cast<uint32_t>(y) * 0xc2b2ae35u;
  h = (h ^ (h >> 16)) * 0x7feb352du;
  h = (h ^ (h >> 15)) * 0x846ca68bu;
  return h ^ (h >> 16);
}
// [0, 1)
float UnitOf(uint32_t hash) { return static_cast<float>(hash >> 8) * 0x1.0p-24f; }

int FloorOf(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (x < static_cast<float>(truncated));
}
float Smooth(float x) { return x * x * (3 - 2 * x); }
float SmoothStep(float low, float high, float x) {
  return Smooth(std::clamp((x - low) / (high - low), 0.0f, 1.0f));
}
LinearRgb Mix(const LinearRgb& a, const LinearRgb& b, float t) { return a + t * (b - a); }

// Random values at the integer lattice, smoothly interpolated; -1..1.
float ValueNoise(const Uv& p, uint32_t seed) {
  const int x = FloorOf(p.x()), y = FloorOf(p.y());
  const float s = Smooth(p.x() - static_cast<float>(x)), t = Smooth(p.y() - static_cast<float>(y));
  const float v00 = UnitOf(HashCell(x, y, seed)), v10 = UnitOf(HashCell(x + 1, y, seed));
  const float v01 = UnitOf(HashCell(x, y + 1, seed)), v11 = UnitOf(HashCell(x + 1, y + 1, seed));
  const float top = v00 + s * (v10 - v00), bottom = v01 + s * (v11 - v01);
  return 2 * (top + t * (bottom - top)) - 1;
}

// How much of value noise with lattice spacing `spacing` is left of its mean over a box: fitted to
// the regression of the mean on the value, and cut where little is left. one_way: the noise is
// stretched so much along one axis that the box averages along the other one only.
float KeptOfOctave(float footprint, float spacing, bool one_way) {
  const float ratio2 = footprint * footprint / (spacing * spacing);
  if (one_way) return std::max(0.0f, (1 / (1 + 0.138f * ratio2) - 0.25f) / 0.75f);
  const float a = 0.3f * ratio2;
  return std::max(0.0f, (1 / (1 + a + 0.13f * a * a) - 0.1f) / 0.9f);
}

// Octaves of value noise with lattice spacings coarsest, coarsest / 2 ..., the amplitude times
// `gain` from one to the next, averaged over the footprint.
float Fractal(const Uv& p, float coarsest, float footprint, float gain, uint32_t seed,
              bool one_way = false) {
  // Every octave is turned, so that the lattices do not line up (cosine and sine of 37 degrees);
  // one that is stretched stays and is only moved.
  const float cos = one_way ? 1.0f : 0.7986355f, sin = one_way ? 0.0f : 0.6018150f;
  Uv q = p;
  float sum = 0, amplitude = 1, spacing = coarsest;
  for (uint32_t octave = 0; octave < 14; ++octave) {
    const float kept = KeptOfOctave(footprint, spacing, one_way);
    if (kept <= 0) break;
    sum += amplitude * kept * ValueNoise(q / spacing, seed + octave * 101u);
    q = Uv(cos * q.x() - sin * q.y() + 3.1f, sin * q.x() + cos * q.y() + 7.7f);
    amplitude *= gain;
    spacing *= 0.5f;
  }
  return sum;
}

// Share of a box of width `footprint` at `distance` from a line that the line covers.
float Line(float distance, float half_width, float footprint) {
  const float half = footprint / 2;
  const float covered =
      std::min(distance + half, half_width) - std::max(distance - half, -half_width);
  return std::max(covered, 0.0f) / footprint;
}

float Band(float footprint) { return std::max(footprint, kTextureBandLimit); }

class Plain : public RoomTexture {
 public:
  explicit Plain(const LinearRgb& color) : color_(color) {}
  LinearRgb Albedo(const Uv&, float) const override { return color_; }

 private:
  LinearRgb color_;
};

class Plaster : public RoomTexture {
 public:
  Plaster(const LinearRgb& color, float contrast, uint32_t seed)
      : color_(color), contrast_(contrast), seed_(seed) {}

  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    const float band = Band(footprint);
    const float rough = Fractal(uv, 0.1f, band, 0.95f, seed_);
    const float stain = Fractal(uv, 0.9f, std::max(band, 0.2f), 0.7f, seed_ + 1);
    // A stain is a little warmer than the paint around it.
    const LinearRgb tint(1 + 0.3f * contrast_ * stain, 1.0f, 1 - 0.4f * contrast_ * stain);
    return color_.cwiseProduct(tint) *
           std::clamp(1 + contrast_ * (1.1f * rough + 0.35f * stain), 0.1f, 1.6f);
  }

 private:
  LinearRgb color_;
  float contrast_;
  uint32_t seed_;
};

class Wallpaper : public RoomTexture {
 public:
  Wallpaper(const LinearRgb& ground, const std::vector<LinearRgb>& leaves, float leaf_length,
            uint32_t seed)
      : ground_(ground), seed_(seed), cell_{leaf_length * 1.1f, leaf_length * 0.5f} {
    for (int layer = 0; layer < 2; ++layer) {
      leaves_[layer].resize(kTable * kTable);
      RandomStream random(MixBits(seed, 11, layer));
      for (Leaf& leaf : leaves_[layer]) {
        leaf.centre = Uv(random.Uniform(), random.Uniform());
        const double angle = random.Uniform(0, 2 * kPi);
        leaf.cos = static_cast<float>(std::cos(angle));
        leaf.sin = static_cast<float>(std::sin(angle));
        leaf.half_length = static_cast<float>(random.Uniform(0.26, 0.5));
        leaf.slender = static_cast<float>(random.Uniform(0.22, 0.5));
        leaf.color = leaves[random.Index(static_cast<int>(leaves.size()))] *
                     static_cast<float>(random.Uniform(0.75, 1.2));
      }
    }
  }

  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    const float band = Band(footprint);
    const float stripe = 0.03f * ValueNoise(Uv(uv.x() / 0.06f, 0.5f), seed_ + 3);
    LinearRgb color = ground_ * (1 + stripe);
    for (int layer = 1; layer >= 0; --layer) AddLeaves(layer, uv, band, &color);
    return color * std::clamp(1 + 0.06f * Fractal(uv, 0.1f, band, 0.95f, seed_ + 4), 0.3f, 1.5f);
  }

 private:
  struct Leaf {
    Uv centre;  // within its cell
    float cos, sin, half_length, slender;
    LinearRgb color;
  };
  static constexpr int kTable = 64;  // cells before the pattern would repeat: 6 m of small leaves

  // A leaf reaches half a cell beyond its own, so four cells can cover a place.
  void AddLeaves(int layer, const Uv& uv, float band, LinearRgb* color) const {
    const Uv p = uv / cell_[layer];
    const float soft = band / cell_[layer];
    const int x0 = FloorOf(p.x() - 0.5f), y0 = FloorOf(p.y() - 0.5f);
    for (int k = 0; k < 4; ++k) {
      const int x = x0 + (k & 1), y = y0 + (k >> 1);
      const Leaf& leaf = leaves_[layer][(y & (kTable - 1)) * kTable + (x & (kTable - 1))];
      const Uv d = p - Uv(static_cast<float>(x), static_cast<float>(y)) - leaf.centre;
      const float along = (leaf.cos * d.x() + leaf.sin * d.y()) / leaf.half_length;
      if (std::abs(along) >= 1) continue;
      const float across = -leaf.sin * d.x() + leaf.cos * d.y();
      const float half_width = leaf.slender * leaf.half_length * (1 - along * along);
      const float cover = Line(across, half_width, soft);
      if (cover <= 0) continue;
      const float rib = 0.35f * Line(across, 0.04f * leaf.half_length, soft);
      *color = Mix(*color, leaf.color * (1 - rib + 0.15f * along), cover);
    }
  }

  LinearRgb ground_;
  uint32_t seed_;
  float cell_[2];
  std::vector<Leaf> leaves_[2];
};

class Brick : public RoomTexture {
 public:
  Brick(const LinearRgb& brick, const LinearRgb& mortar, uint32_t seed)
      : brick_(brick), mortar_(mortar), seed_(seed) {}

  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    constexpr float kLength = 0.24f, kHeight = 0.075f, kJoint = 0.006f;
    const float band = Band(footprint);
    // Bricks are not quite straight.
    const Uv p = uv + 0.003f * Uv(ValueNoise(uv / 0.05f, seed_), ValueNoise(uv / 0.05f, seed_ + 1));
    const int row = FloorOf(p.y() / kHeight);
    const float along = p.x() / kLength + 0.5f * static_cast<float>(row & 1) +
                        0.13f * UnitOf(HashCell(row, 5, seed_));
    const int column = FloorOf(along);
    const uint32_t hash = HashCell(column, row, seed_ + 2);
    const float tone = 0.62f + 0.75f * UnitOf(hash);
    const LinearRgb tint(1, 0.85f + 0.3f * UnitOf(hash * 747796405u + 1), 1);
    const float rough = Fractal(uv, 0.06f, band, 0.9f, seed_ + 3);
    const LinearRgb stone = brick_.cwiseProduct(tint) * tone * (1 + 0.16f * rough);
    const float from_row = (p.y() / kHeight - static_cast<float>(row)) * kHeight;
    const float from_end = (along - static_cast<float>(column)) * kLength;
    const float joint = std::max(Line(std::min(from_row, kHeight - from_row), kJoint, band),
                                 Line(std::min(from_end, kLength - from_end), kJoint, band));
    return Mix(stone, mortar_ * (1 + 0.1f * rough), joint);
  }

 private:
  LinearRgb brick_, mortar_;
  uint32_t seed_;
};

// Relative brightness of wood with its grain along u.
float Grain(const Uv& uv, float band, uint32_t seed) {
  // The grain bends slowly; fibres are 25 times as long as wide.
  const float bend = 0.02f * ValueNoise(Uv(uv.x() / 0.7f, uv.y() / 0.15f), seed);
  const float across = uv.y() + bend;
  const Uv stretched(uv.x() / 25, across);
  const float fibres = Fractal(stretched, 0.012f, band, 0.9f, seed + 1, true);
  const float year =
      Fractal(Uv(uv.x() / 12, across), 0.05f, std::max(band, 0.012f), 0.8f, seed + 2, true);
  const float pores = Fractal(Uv(uv.x() / 3, across), 0.02f, band, 0.9f, seed + 3);
  return 1 + 0.12f * fibres + 0.16f * year + 0.07f * pores;
}

// Darkness of the knots, one in some of the cells of 0.4 x 0.12 m.
float Knots(const Uv& uv, float band, uint32_t seed) {
  const int x = FloorOf(uv.x() / 0.4f), y = FloorOf(uv.y() / 0.12f);
  const uint32_t hash = HashCell(x, y, seed);
  if (hash % 5 > 1) return 0;
  const Uv centre((static_cast<float>(x) + 0.2f + 0.6f * UnitOf(hash * 747796405u + 3)) * 0.4f,
                  (static_cast<float>(y) + 0.25f + 0.5f * UnitOf(hash * 2891336453u + 7)) * 0.12f);
  const Uv d = (uv - centre).cwiseProduct(Uv(0.55f, 1.0f));
  const float size = 0.006f + 0.009f * UnitOf(hash * 277803737u + 5);
  const float rings =
      0.25f * std::cos(d.norm() / size * 5.0f) * SmoothStep(3 * size, size, d.norm());
  // Wider but as much paler under a wide footprint.
  const float paler = size * size / ((size + 0.4f * band) * (size + 0.4f * band));
  return SmoothStep(size + band, size * 0.4f, d.norm()) * 0.55f * paler +
         (band < size ? rings : 0.0f) * SmoothStep(0, size, d.norm());
}

class Wood : public RoomTexture {
 public:
  Wood(const LinearRgb& wood, uint32_t seed) : wood_(wood), seed_(seed) {}
  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    const float band = Band(footprint);
    const float shade = Grain(uv, band, seed_) * (1 - Knots(uv, band, seed_ + 9));
    return wood_ * std::clamp(shade, 0.15f, 1.5f);
  }

 private:
  LinearRgb wood_;
  uint32_t seed_;
};

class Planks : public RoomTexture {
 public:
  Planks(const LinearRgb& wood, uint32_t seed) : wood_(wood), seed_(seed) {}

  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    constexpr float kWidth = 0.13f, kLength = 1.35f;
    const float band = Band(footprint);
    const int row = FloorOf(uv.y() / kWidth);
    const float along = uv.x() / kLength + UnitOf(HashCell(row, 1, seed_));
    const int plank = FloorOf(along);
    const uint32_t hash = HashCell(plank, row, seed_ + 1);
    const float tone = 0.7f + 0.5f * UnitOf(hash);
    const LinearRgb tint(1, 0.93f + 0.1f * UnitOf(hash * 747796405u + 1), 0.85f + 0.2f * tone);
    // Every plank is cut from another place of the tree.
    const Uv p =
        uv + Uv(3.7f * static_cast<float>(hash % 61), 0.41f * static_cast<float>(hash % 83));
    const float shade = Grain(p, band, seed_ + 2) * (1 - Knots(p, band, seed_ + 3));
    const float from_side = uv.y() - static_cast<float>(row) * kWidth;
    const float from_end = (along - static_cast<float>(plank)) * kLength;
    const float joint = std::max(Line(std::min(from_side, kWidth - from_side), 0.0012f, band),
                                 Line(std::min(from_end, kLength - from_end), 0.0015f, band));
    return wood_.cwiseProduct(tint) * (tone * std::clamp(shade, 0.15f, 1.5f) * (1 - 0.7f * joint));
  }

 private:
  LinearRgb wood_;
  uint32_t seed_;
};

class Plaid : public RoomTexture {
 public:
  Plaid(const std::vector<LinearRgb>& yarns, float mean_stripe, uint32_t seed) : seed_(seed) {
    for (int way = 0; way < 2; ++way) {
      RandomStream random(MixBits(seed, 17, way));
      for (float end = 0; end < kLength;) {
        end += mean_stripe * static_cast<float>(random.Uniform(0.2, 1.8));
        stripes_[way].push_back({end, yarns[random.Index(static_cast<int>(yarns.size()))]});
      }
    }
  }

  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    const float band = Band(footprint);
    const LinearRgb warp = Stripe(0, uv.x(), band), weft = Stripe(1, uv.y(), band);
    const float slub = Fractal(Uv(uv.x(), uv.y() / 6), 0.012f, band, 0.9f, seed_ + 1, true) +
                       Fractal(Uv(uv.x() / 6, uv.y()), 0.012f, band, 0.9f, seed_ + 2, true);
    const float worn = Fractal(uv, 0.25f, std::max(band, 0.03f), 0.8f, seed_ + 3);
    return Mix(warp, weft, 0.5f) * std::clamp(1 + 0.1f * slub + 0.08f * worn, 0.2f, 1.6f);
  }

 private:
  struct StripeEnd {
    float end;
    LinearRgb color;
  };
  static constexpr float kLength = 16;  // metres before the stripes repeat

  // The mean over `band`: of all the stripes that lie in it, the first and the last one in part.
  LinearRgb Stripe(int way, float position, float band) const {
    float x = std::fmod(position, kLength);
    if (x < 0) x += kLength;
    const auto& stripes = stripes_[way];
    float from = x - band / 2;
    const float to = x + band / 2;
    const auto found = std::upper_bound(stripes.begin(), stripes.end(), from,
                                        [](float a, const StripeEnd& b) { return a < b.end; });
    size_t i = std::min<size_t>(found - stripes.begin(), stripes.size() - 1);
    LinearRgb sum = LinearRgb::Zero();
    for (; i + 1 < stripes.size() && stripes[i].end < to; ++i) {
      sum += (stripes[i].end - from) * stripes[i].color;
      from = stripes[i].end;
    }
    return (sum + (to - from) * stripes[i].color) / band;
  }

  uint32_t seed_;
  std::vector<StripeEnd> stripes_[2];
};

class Blotches : public RoomTexture {
 public:
  Blotches(const LinearRgb& first, const LinearRgb& second, float size, uint32_t seed)
      : first_(first), second_(second), size_(size), seed_(seed) {}
  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    const float band = Band(footprint);
    const float blend = 0.5f + 0.9f * Fractal(uv, size_, band, 0.75f, seed_);
    const float fine = Fractal(uv, 0.02f, band, 0.95f, seed_ + 1);
    return Mix(first_, second_, std::clamp(blend, 0.0f, 1.0f)) * (1 + 0.08f * fine);
  }

 private:
  LinearRgb first_, second_;
  float size_;
  uint32_t seed_;
};

class Picture : public RoomTexture {
 public:
  Picture(const cv::Mat& picture, float width, float height, float grain, uint32_t seed)
      : grain_(grain), seed_(seed), texel_(width / static_cast<float>(picture.cols)) {
    if (picture.type() != CV_8UC3) throw std::invalid_argument("a picture is 8-bit BGR");
    scale_ =
        Uv(static_cast<float>(picture.cols) / width, static_cast<float>(picture.rows) / height);
    picture_ = picture.clone();
    // Averages are taken in linear light.
    const auto& table = LinearFromSrgbByte();
    cv::Mat linear(picture.size(), CV_16UC3);
    for (int y = 0; y < picture.rows; ++y) {
      const auto* const bytes = picture.ptr<cv::Vec3b>(y);
      auto* const row = linear.ptr<cv::Vec3w>(y);
      for (int x = 0; x < picture.cols; ++x) {
        for (int k = 0; k < 3; ++k) {
          row[x][k] = static_cast<uint16_t>(kLinearOne * table[bytes[x][k]] + 0.5f);
        }
      }
    }
    while (std::min(linear.cols, linear.rows) >= 4) {
      cv::Mat half;
      cv::resize(linear, half, {(linear.cols + 1) / 2, (linear.rows + 1) / 2}, 0, 0,
                 cv::INTER_AREA);
      coarser_.push_back(half);
      linear = half;
    }
  }

  LinearRgb Albedo(const Uv& uv, float footprint) const override {
    const float band = Band(footprint);
    const Uv p = uv.cwiseProduct(scale_);
    // Linear interpolation between texels of width t blurs like a box of width 1.73 t.
    const float level = std::clamp(std::log2(band / texel_) - 0.79f, 0.0f,
                                   static_cast<float>(coarser_.size()) - 0.001f);
    const int fine = static_cast<int>(level);
    LinearRgb color = Lookup(fine, p);
    if (fine < static_cast<int>(coarser_.size())) {
      color = Mix(color, Lookup(fine + 1, p), level - static_cast<float>(fine));
    }
    if (grain_ > 0)
      color *= std::clamp(1 + grain_ * Fractal(uv, 0.06f, band, 0.9f, seed_), 0.2f, 1.6f);
    return color;
  }

 private:
  static constexpr float kLinearOne = 65535;

  // p in pixels of the picture; bilinear, the border repeated. Level 0 is the picture itself.
  LinearRgb Lookup(int level, const Uv& p) const {
    const cv::Mat& image = level == 0 ? picture_ : coarser_[level - 1];
    const float sx = static_cast<float>(image.cols) / static_cast<float>(picture_.cols);
    const float sy = static_cast<float>(image.rows) / static_cast<float>(picture_.rows);
    const float x = std::clamp(p.x() * sx - 0.5f, 0.0f, static_cast<float>(image.cols - 1));
    const float y = std::clamp(p.y() * sy - 0.5f, 0.0f, static_cast<float>(image.rows - 1));
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const int x1 = std::min(x0 + 1, image.cols - 1), y1 = std::min(y0 + 1, image.rows - 1);
    const float s = x - static_cast<float>(x0), t = y - static_cast<float>(y0);
    const auto& table = LinearFromSrgbByte();
    const auto at = [&](int row, int column) -> LinearRgb {
      if (level == 0) {
        const auto& byte = image.at<cv::Vec3b>(row, column);
        return {table[byte[2]], table[byte[1]], table[byte[0]]};
      }
      const auto& value = image.at<cv::Vec3w>(row, column);
      return LinearRgb(value[2], value[1], value[0]) / kLinearOne;
    };
    return Mix(Mix(at(y0, x0), at(y0, x1), s), Mix(at(y1, x0), at(y1, x1), s), t);
  }

  float grain_;
  uint32_t seed_;
  float texel_;                   // metres
  Uv scale_;                      // texels per metre
  cv::Mat picture_;               // 8-bit BGR, sRGB
  std::vector<cv::Mat> coarser_;  // 16-bit BGR, linear; each half the size of the one before
};

}  // namespace

LinearRgb RgbFromSrgb(int red, int green, int blue) {
  const auto& table = LinearFromSrgbByte();
  return {table[red], table[green], table[blue]};
}

LinearRgb MeanAlbedo(const RoomTexture& texture) {
  constexpr int kSide = 16;
  constexpr float kStep = 0.7f / kSide;
  LinearRgb sum = LinearRgb::Zero();
  for (int i = 0; i < kSide * kSide; ++i) {
    const Eigen::Vector2f at(static_cast<float>(i % kSide) + 0.5f,
                             static_cast<float>(i / kSide) + 0.5f);
    sum += texture.Albedo(kStep * at, kStep);
  }
  return sum / (kSide * kSide);
}

TexturePtr MakePlain(const LinearRgb& color) { return std::make_shared<Plain>(color); }
TexturePtr MakePlaster(const LinearRgb& color, float contrast, uint32_t seed) {
  return std::make_shared<Plaster>(color, contrast, seed);
}
TexturePtr MakeWallpaper(const LinearRgb& ground, const std::vector<LinearRgb>& leaves,
                         float leaf_length, uint32_t seed) {
  return std::make_shared<Wallpaper>(ground, leaves, leaf_length, seed);
}
TexturePtr MakeBrick(const LinearRgb& brick, const LinearRgb& mortar, uint32_t seed) {
  return std::make_shared<Brick>(brick, mortar, seed);
}
TexturePtr MakePlanks(const LinearRgb& wood, uint32_t seed) {
  return std::make_shared<Planks>(wood, seed);
}
TexturePtr MakeWood(const LinearRgb& wood, uint32_t seed) {
  return std::make_shared<Wood>(wood, seed);
}
TexturePtr MakePlaid(const std::vector<LinearRgb>& yarns, float mean_stripe, uint32_t seed) {
  return std::make_shared<Plaid>(yarns, mean_stripe, seed);
}
TexturePtr MakeBlotches(const LinearRgb& first, const LinearRgb& second, float size,
                        uint32_t seed) {
  return std::make_shared<Blotches>(first, second, size, seed);
}
TexturePtr MakePicture(const cv::Mat& picture, float width, float height, float grain,
                       uint32_t seed) {
  return std::make_shared<Picture>(picture, width, height, grain, seed);
}

}  // namespace roomtex
