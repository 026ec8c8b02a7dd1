#include "exporters/report/picture_viewer.h"

#include <array>
#include <cstddef>

#include "exporters/png_encode.h"
#include "exporters/report/value_map.h"
#include "exporters/report_html.h"
#include "exporters/shared_exponent.h"

namespace relief {

namespace {

/// Wider than the page is; more pixels only make the file larger.
constexpr int kMostPixels = 2048;

constexpr const char* kScript = R"(<script>
'use strict';
(() => {
  const viewer = document.currentScript.previousElementSibling;
  const find = (selector) => viewer.querySelector(selector);
  const {scale, x: cropX, y: cropY} = viewer.dataset;
  const stage = find('.stage'), exposure = find('.exposure'), wipe = find('.wipe'), probe = find('.probe');

  const pixelsOf = async (image) => {
    await image.decode();
    const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
    const context = canvas.getContext('2d', {willReadFrequently: true});
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, canvas.width, canvas.height);
  };
  const linear = (mantissa, exponent) => exponent ? (mantissa + 0.5) * 2 ** (exponent - 136) : 0;
  const display = (value) =>
      Math.round(255 * Math.min(1, value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));

  const pictures = [];
  const draw = () => {
    const stops = Number(exposure.value), gain = 2 ** stops;
    find('.stops').textContent = (stops < 0 ? '\u2212' : '+') + Math.abs(stops).toFixed(1) + ' stops';
    const codes = new Uint8Array(65536);
    for (let i = 0; i < 65536; ++i) codes[i] = display(gain * linear(i & 255, i >> 8));
    for (const {canvas, mantissas, exponents} of pictures) {
      const shown = new ImageData(canvas.width, canvas.height), from = mantissas.data, to = shown.data;
      for (let i = 0; i < to.length; i += 4) {
        const row = exponents.data[i] << 8;
        to[i] = codes[row | from[i]];
        to[i + 1] = codes[row | from[i + 1]];
        to[i + 2] = codes[row | from[i + 2]];
        to[i + 3] = 255;
      }
      canvas.getContext('2d').putImageData(shown, 0, 0);
    }
  };
  const place = () => {
    if (wipe) stage.style.setProperty('--wipe', wipe.value + '%');
  };
  const at = (event) => {
    const box = stage.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };

  exposure.addEventListener('input', draw);
  find('.reset').addEventListener('click', () => { exposure.value = 0; draw(); });
  if (wipe) {
    wipe.addEventListener('input', place);
    const drag = (event) => { wipe.value = 100 * at(event)[0]; place(); };
    stage.addEventListener('pointerdown', (event) => { stage.setPointerCapture(event.pointerId); drag(event); });
    stage.addEventListener('pointermove', (event) => { if (event.buttons) drag(event); });
  }
  stage.addEventListener('pointermove', (event) => {
    const {canvas} = pictures[0], [u, v] = at(event);
    const x = Math.floor(u * canvas.width), y = Math.floor(v * canvas.height);
    if (x < 0 || y < 0 || x >= canvas.width || y >= canvas.height) return;
    const i = 4 * (y * canvas.width + x);
    probe.textContent = `pixel ${x * scale + Number(cropX)},${y * scale + Number(cropY)}` + pictures.map((p) => {
      const rgb = [0, 1, 2].map((c) => linear(p.mantissas.data[i + c], p.exponents.data[i]).toPrecision(3));
      return ` \u00b7 ${p.name}: ${rgb.join(' ')}`;
    }).join('');
  });

  place();
  Promise.all([...viewer.querySelectorAll('canvas')].map(async (canvas) => {
    const [mantissas, exponents] =
        await Promise.all(canvas.dataset.images.split(' ').map((name) => pixelsOf(find('img.' + name))));
    return {canvas, mantissas, exponents, name: canvas.getAttribute('aria-label')};
  })).then((loaded) => { pictures.push(...loaded); draw(); viewer.classList.add('ready'); });
})();
</script>
)";

std::string image_html(const std::string& name, const std::string& png)
{
  return "<img hidden class='" + name + "' alt='' src='data:image/png;base64," + base64_encode(png) + "'>\n";
}

/// A canvas and its pixels.
/// @param label  distinguishes the classes of what belongs to it
std::string canvas_html(const ViewedPicture& picture, const std::string& label, int* width, int* height, int* factor)
{
  std::array<ValueImage, 3> planes;
  ImageView reduced;
  for (std::size_t c = 0; c < planes.size(); ++c) {
    planes[c] = value_image_reduced(value_image_of(picture.image, c), kMostPixels, factor);
    reduced.width = planes[c].width;
    reduced.height = planes[c].height;
    reduced.channels.push_back({planes[c].values.data(), 1, planes[c].width, ChannelType::kFloat, ""});
  }
  *width = reduced.width;
  *height = reduced.height;
  const SharedExponentImage encoded = shared_exponent_encode(reduced);
  return "<canvas class='" + label + "' width='" + std::to_string(reduced.width) + "' height='" +
         std::to_string(reduced.height) + "' role='img' aria-label='" + html_escape(picture.name) + "' data-images='" +
         label + "-mantissas " + label + "-exponents'></canvas>\n" +
         image_html(label + "-mantissas", png_encode(reduced.width, reduced.height, encoded.mantissas)) +
         image_html(label + "-exponents", png_encode(reduced.width, reduced.height, encoded.exponents));
}

}  // namespace

std::string html_picture_viewer(const ViewedPicture& first, const ViewedPicture& second, const ViewerOptions& options)
{
  const bool has_two = !second.image.channels.empty();
  int width = 0, height = 0, factor = 1;
  std::string stage = canvas_html(first, "first", &width, &height, &factor);
  if (has_two) {
    stage += canvas_html(second, "second", &width, &height, &factor);
    stage += "<div class='divider'></div><span class='tag'>" + html_escape(first.name) +
             "</span><span class='tag right'>" + html_escape(second.name) + "</span>\n";
  }
  std::string html = "<div class='viewer' data-scale='" + std::to_string(factor) + "' data-x='" +
                     std::to_string(options.crop_x) + "' data-y='" + std::to_string(options.crop_y) + "'>\n";
  html += "<div class='stage' style='--aspect:" + attribute_number(static_cast<double>(width) / height) +
          ";--width:" + std::to_string(width) + "px'>\n" + stage + "</div>\n<div class='controls'>";
  html += "<label>Exposure <input class='exposure' type='range' min='-10' max='10' step='0.1' value='" +
          attribute_number(options.exposure) + "'></label><output class='stops'></output>" +
          "<button class='reset' type='button'>0</button>";
  if (has_two) {
    html += "<label>Wipe <input class='wipe' type='range' min='0' max='100' step='0.1' value='50'></label>";
  }
  html += "<span class='probe'></span></div>\n<p class='note'>Shown by the sRGB curve" +
          std::string(factor > 1 ? ", means of " + std::to_string(factor) + " × " + std::to_string(factor) + " pixels"
                                 : "") +
          ". Point at a pixel for its linear values" + (has_two ? "; drag to wipe." : ".") +
          "</p><noscript><p>The picture is drawn by JavaScript, which is switched off.</p></noscript></div>\n";
  return html + kScript;
}

}  // namespace relief
