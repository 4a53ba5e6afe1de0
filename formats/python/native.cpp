// The reference decoders for Python: numpy arrays in and out, the interpreter's lock released while they work.
//
// Part of the package `patina` (formats/python/patina/__init__.py), which is what people import.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <string>
#include <vector>

#include "formats/decoder/patina_brdf_decoder.h"
#include "formats/decoder/patina_decoder.h"
#include "formats/decoder/patina_svbrdf_decoder.h"

namespace py = pybind11;

namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

template <typename D>
D Load(const std::string& path) {
  D decoder;
  std::string problem;
  const auto status = D::Load(path, &decoder, &problem);
  if (status == D::LoadStatus::kOk) return decoder;
  if (status == D::LoadStatus::kNotFound) {
    PyErr_SetString(PyExc_FileNotFoundError, problem.c_str());
    throw py::error_already_set();
  }
  throw py::value_error(problem);
}

const char* EncodingName(patina::Decoder::Encoding encoding) {
  switch (encoding) {
    case patina::Decoder::Encoding::kSrgb:
      return "srgb";
    case patina::Decoder::Encoding::kSignedLog:
      return "signed_log";
    case patina::Decoder::Encoding::kNormalXy:
      return "normal_xy";
    case patina::Decoder::Encoding::kLinear:
      break;
  }
  return "linear";
}

py::list Channels(const patina::Decoder& decoder) {
  py::list list;
  for (const patina::Decoder::Channel& channel : decoder.channels()) {
    py::dict entry;
    entry["map"] = channel.map;
    entry["component"] = channel.component;
    entry["encoding"] = EncodingName(channel.encoding);
    entry["constant"] = channel.output < 0;
    list.append(entry);
  }
  return list;
}

// [channel][y][x]
Floats DecodeMip(const patina::Decoder& decoder, int level, bool physical) {
  if (level < 0 || level >= decoder.levels())
    throw py::index_error("level " + std::to_string(level) + ": the container has mips 0 to " + std::to_string(decoder.levels() - 1));
  const py::ssize_t height = decoder.MipHeight(level), width = decoder.MipWidth(level);
  Floats out({static_cast<py::ssize_t>(decoder.channels().size()), height, width});
  float* data = out.mutable_data();
  const py::gil_scoped_release release;
  const std::vector<float> coded = decoder.DecodeMip(level);
  const size_t plane = static_cast<size_t>(height) * static_cast<size_t>(width);
  for (size_t i = 0; i < coded.size(); ++i)
    data[i] = physical ? patina::Decoder::ToPhysical(decoder.channels()[i / plane], coded[i]) : coded[i];
  return out;
}

// Rows of `columns` numbers.
void CheckRows(const Floats& array, py::ssize_t columns, const char* name) {
  if (array.ndim() == 2 && array.shape(1) == columns) return;
  throw py::value_error(std::string(name) + ": an array of N rows of " + std::to_string(columns) + " numbers is needed");
}

// Rows of u, v, level of detail.
void CheckPlaces(const Floats& places) {
  CheckRows(places, 3, "places");
  for (py::ssize_t i = 0; i < places.size(); ++i) {
    if (!std::isfinite(places.data()[i])) throw py::value_error("places: row " + std::to_string(i / 3) + " is not finite");
  }
}

// [n][channel] at rows of u, v, level of detail.
Floats Sample(const patina::Decoder& decoder, const Floats& places, bool physical) {
  CheckPlaces(places);
  const py::ssize_t count = places.shape(0), channels = static_cast<py::ssize_t>(decoder.channels().size());
  const float* in = places.data();
  Floats out({count, channels});
  float* data = out.mutable_data();
  const py::gil_scoped_release release;
  for (py::ssize_t i = 0; i < count; ++i) {
    const float* place = in + 3 * i;
    float* row = data + channels * i;
    const auto u = static_cast<double>(place[0]), v = static_cast<double>(place[1]), lod = static_cast<double>(place[2]);
    if (physical) {
      decoder.Physical(u, v, lod, row);
    } else {
      decoder.Coded(u, v, lod, row);
    }
  }
  return out;
}

void CheckSameLength(const Floats& a, const Floats& b) {
  if (a.shape(0) != b.shape(0))
    throw py::value_error("both arrays need as many rows: these have " + std::to_string(a.shape(0)) + " and " + std::to_string(b.shape(0)));
}

Floats EvaluateBrdf(const patina::BrdfDecoder& decoder, const Floats& wi, const Floats& wo) {
  CheckRows(wi, 3, "wi");
  CheckRows(wo, 3, "wo");
  CheckSameLength(wi, wo);
  const py::ssize_t count = wi.shape(0);
  Floats out({count, py::ssize_t{3}});
  const float *a = wi.data(), *b = wo.data();
  float* data = out.mutable_data();
  const py::gil_scoped_release release;
  for (py::ssize_t i = 0; i < count; ++i) decoder.Evaluate(a + 3 * i, b + 3 * i, data + 3 * i);
  return out;
}

// places: as of Sample.
Floats EvaluateSvbrdf(const patina::SvbrdfDecoder& decoder, const Floats& wi, const Floats& wo, const Floats& places) {
  CheckRows(wi, 3, "wi");
  CheckRows(wo, 3, "wo");
  CheckPlaces(places);
  CheckSameLength(wi, wo);
  CheckSameLength(wi, places);
  const py::ssize_t count = wi.shape(0);
  Floats out({count, py::ssize_t{3}});
  const float *a = wi.data(), *b = wo.data(), *at = places.data();
  float* data = out.mutable_data();
  const py::gil_scoped_release release;
  for (py::ssize_t i = 0; i < 3 * count; i += 3) {
    const auto u = static_cast<double>(at[i]), v = static_cast<double>(at[i + 1]), lod = static_cast<double>(at[i + 2]);
    decoder.Evaluate(a + i, b + i, u, v, lod, data + i);
  }
  return out;
}

// wo [n][3] and pdf [n]; a lost sample has pdf 0.
py::tuple SampleBrdf(const patina::BrdfDecoder& decoder, const Floats& wi, const Floats& u) {
  CheckRows(wi, 3, "wi");
  CheckRows(u, 3, "u");
  CheckSameLength(wi, u);
  const py::ssize_t count = wi.shape(0);
  Floats wo({count, py::ssize_t{3}}), pdf(count);
  const float *in = wi.data(), *numbers = u.data();
  float *directions = wo.mutable_data(), *densities = pdf.mutable_data();
  {
    const py::gil_scoped_release release;
    for (py::ssize_t i = 0; i < count; ++i) {
      if (decoder.Sample(in + 3 * i, numbers + 3 * i, directions + 3 * i, densities + i)) continue;
      directions[3 * i] = directions[3 * i + 1] = directions[3 * i + 2] = densities[i] = 0;
    }
  }
  return py::make_tuple(wo, pdf);
}

Floats PdfOfBrdf(const patina::BrdfDecoder& decoder, const Floats& wi, const Floats& wo) {
  CheckRows(wi, 3, "wi");
  CheckRows(wo, 3, "wo");
  CheckSameLength(wi, wo);
  Floats out(wi.shape(0));
  float* data = out.mutable_data();
  for (py::ssize_t i = 0; i < wi.shape(0); ++i) data[i] = decoder.Pdf(wi.data() + 3 * i, wo.data() + 3 * i);
  return out;
}

}  // namespace

PYBIND11_MODULE(_native, module) {
  using patina::BrdfDecoder;
  using patina::Decoder;
  using patina::SvbrdfDecoder;
  py::class_<Decoder>(module, "Material")
      .def(py::init(&Load<Decoder>))
      .def_property_readonly("width", &Decoder::width)
      .def_property_readonly("height", &Decoder::height)
      .def_property_readonly("levels", &Decoder::levels)
      .def_property_readonly("working_space", &Decoder::working_space)
      .def_property_readonly("channels", &Channels)
      .def("decode_mip", &DecodeMip)
      .def("sample", &Sample);
  py::class_<BrdfDecoder>(module, "Brdf")
      .def(py::init(&Load<BrdfDecoder>))
      .def_property_readonly("isotropic", &BrdfDecoder::isotropic)
      .def_property_readonly("has_sampler", &BrdfDecoder::has_sampler)
      .def("evaluate", &EvaluateBrdf)
      .def("sample", &SampleBrdf)
      .def("pdf", &PdfOfBrdf);
  py::class_<SvbrdfDecoder>(module, "Svbrdf")
      .def(py::init(&Load<SvbrdfDecoder>))
      .def_property_readonly("width", &SvbrdfDecoder::width)
      .def_property_readonly("height", &SvbrdfDecoder::height)
      .def_property_readonly("levels", &SvbrdfDecoder::levels)
      .def("evaluate", &EvaluateSvbrdf);
}
