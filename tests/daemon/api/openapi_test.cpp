// schemas/openapi.json against the routes, and against what the routes answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "daemon/api/api.h"
#include "formats/base/file_io.h"
#include "tests/daemon/api/fake_service.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using ::testing::ContainerEq;
using ::testing::IsEmpty;
using Json = nlohmann::json;

Json Description() {
  return Json::parse(*ReadTextFile(PATINA_SOURCE_DIR "/schemas/openapi.json", 1 << 20));
}

// What of a value does not fit a schema of the kinds that the description uses.
void FindMisfits(const Json& description, Json schema, const Json& value, const std::string& at,
                 std::vector<std::string>* misfits) {
  if (schema.contains("$ref")) {
    const std::string ref = schema["$ref"];
    schema = description.at(Json::json_pointer(ref.substr(1)));
  }
  if (schema.contains("enum")) {
    const Json& values = schema["enum"];
    if (std::find(values.begin(), values.end(), value) == values.end())
      misfits->push_back(at + ": not one of the enum");
  }
  if (schema.contains("const") && schema["const"] != value)
    misfits->push_back(at + ": not the const");
  const std::string type = schema.value("type", "");
  const bool fits =
      type.empty() || (type == "object" && value.is_object()) ||
      (type == "array" && value.is_array()) || (type == "string" && value.is_string()) ||
      (type == "integer" && value.is_number_integer()) || (type == "number" && value.is_number()) ||
      (type == "boolean" && value.is_boolean());
  if (!fits) {
    misfits->push_back(at + ": is no " + type);
    return;
  }
  for (const Json& key : schema.value("required", Json::array())) {
    if (!value.contains(key))
      misfits->push_back(at + "/" + key.get<std::string>() + ": is missing");
  }
  if (value.is_object() && schema.contains("properties")) {
    for (const auto& [key, member] : value.items()) {
      const Json& known = schema["properties"];
      if (known.contains(key)) {
        FindMisfits(description, known[key], member, at + "/" + key, misfits);
      } else if (schema.value("additionalProperties", Json(true)) == Json(false)) {
        misfits->push_back(at + "/" + key + ": is not described");
      }
    }
  }
  if (value.is_array() && schema.contains("items")) {
    for (size_t i = 0; i < value.size(); ++i) {
      FindMisfits(description, schema["items"], value[i], at + "/" + std::to_string(i), misfits);
    }
  }
}

TEST(OpenApi, DescribesEveryRouteAndNoOther) {
  const Json description = Description();
  EXPECT_EQ(description["openapi"], "3.1.0");
  std::set<std::string> described, routes;
  for (const auto& [path, methods] : description["paths"].items()) {
    for (const auto& [method, operation] : methods.items()) {
      std::string upper = method;
      for (char& c : upper) c = static_cast<char>(std::toupper(c));
      described.insert(upper + " " + path + " " + operation["operationId"].get<std::string>());
    }
  }
  for (const ApiRoute& route : ApiRoutes())
    routes.insert(std::string(route.method) + " " + route.path + " " + route.operation);
  EXPECT_THAT(routes, ContainerEq(described));
}

TEST(OpenApi, RefersToNothingThatIsNotThere) {
  const Json description = Description();
  const Json flat = description.flatten();
  int references = 0;
  for (const auto& [pointer, value] : flat.items()) {
    if (pointer.size() < 5 || pointer.compare(pointer.size() - 5, 5, "/$ref") != 0) continue;
    ++references;
    EXPECT_TRUE(description.contains(Json::json_pointer(value.get<std::string>().substr(1))))
        << pointer;
  }
  EXPECT_GT(references, 100);
}

TEST(OpenApi, DescribesWhatIsAnswered) {
  const Json description = Description();
  test::TemporaryDirectory folder;
  ASSERT_OK(WriteFileDurably(folder / "manifest.json", std::string_view("{}")));
  FakeService service;
  service.assets["wall"] = {"wall", "/out", "/drop/wall", "baked", "", 1, "r1", folder.path(), 1};
  service.jobs[1].record.due_ms = 1;
  service.jobs[3].record.revision = "r";
  service.jobs[3].record.container = "/out/wall3/r";
  service.jobs[3].record.finished_ms = 1;
  ApiOptions options;
  options.default_out = "/out";
  Api api(options, &service, nullptr, &NoLog());
  std::set<std::string> tried;
  for (const ApiRoute& route : ApiRoutes()) {
    for (const char* id : {"1", "2", "3", "77"}) {
      HttpRequest request;
      request.method = route.method;
      request.path = route.path;
      const auto replace = [&](const std::string& name, const std::string& value) {
        const size_t at = request.path.find(name);
        if (at != std::string::npos) request.path.replace(at, name.size(), value);
      };
      replace("{id}", id);
      replace("{name}", std::string(id) == "77" ? "missing" : "wall");
      replace("{file}", "manifest.json");
      request.headers = {{"Content-Type", "application/json"}};
      const std::string operation = route.operation;
      if (operation == "submitJob" && std::string(id) != "77")
        request.body = R"({"job": {"kind": "material", "asset": "wall", "folder": "/maps"}})";
      if (operation == "setJobPriority") request.body = R"({"priority": 1})";
      const HttpResponse response = api.Handle(request);
      std::string method = route.method;
      for (char& c : method) c = static_cast<char>(std::tolower(c));
      const Json& described = description["paths"][route.path][method]["responses"];
      const std::string status = std::to_string(response.status);
      ASSERT_TRUE(described.contains(status)) << operation << " answers " << status;
      tried.insert(operation + " " + status);
      if (response.content_type == "text/event-stream" || response.file) continue;
      Json answer = described[status];
      if (answer.contains("$ref"))
        answer = description.at(Json::json_pointer(answer["$ref"].get<std::string>().substr(1)));
      const std::string type = response.content_type.substr(0, response.content_type.find(';'));
      ASSERT_TRUE(answer["content"].contains(type)) << operation << " answers " << type;
      if (type != "application/json" && type != "application/problem+json") continue;
      std::vector<std::string> misfits;
      FindMisfits(description, answer["content"][type]["schema"], Json::parse(response.body), "",
                  &misfits);
      EXPECT_THAT(misfits, IsEmpty()) << operation << " " << status << ": " << response.body;
    }
  }
  EXPECT_GE(tried.size(), 30u);
  EXPECT_THAT(tried, ::testing::IsSupersetOf({"submitJob 202", "submitJob 400", "cancelJob 202"}));
}

TEST(OpenApi, IsServed) {
  FakeService service;
  Api api({}, &service, nullptr, &NoLog());
  HttpRequest request;
  request.method = "GET";
  request.path = "/v1/openapi.json";
  EXPECT_EQ(Json::parse(api.Handle(request).body), Description());
}

}  // namespace
}  // namespace patina::daemon
