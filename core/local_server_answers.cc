#include "core/local_server_answers.h"

#include <algorithm>
#include <cstring>
#include <new>

#include "core/error.h"
#include "core/json_text.h"
#include "core/local_server_connection.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr size_t kBlockBytes = size_t{1} << 16;

}  // namespace

void SetJson(httplib::Response& response, int status, const std::string& text) {
  response.status = status;
  response.set_content(text, "application/json");
}

void SetError(httplib::Response& response, int status, const std::string& sentence) {
  SetJson(response, status, ErrorText(sentence));
}

std::string RefusalPage() {
  return "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Not this address</title>"
         "<link rel=\"icon\" href=\"data:,\"><h1>This address does not open anything</h1><p>" +
         std::string(kLacksToken) +
         "</p><p>It may be a link from an earlier run. Start the command again and open what it "
         "prints. What stands behind the # of an old link is the point of view: put it behind the "
         "new address.</p></html>";
}

void SetContent(const httplib::Request& request, const LocalServer::Content& content,
                httplib::Response& response) {
  const std::string etag = "\"" + content.etag + "\"";
  response.headers.erase("Cache-Control");
  response.set_header("Cache-Control", content.immutable      ? "private, max-age=86400, immutable"
                                       : content.etag.empty() ? "no-store"
                                                              : "private, no-cache");
  if (!content.etag.empty()) {
    response.set_header("ETag", etag);
    if (request.get_header_value("If-None-Match").find(etag) != std::string::npos) {
      response.status = 304;
      return;
    }
  }
  response.status = 200;
  if (!content.bytes || content.bytes->empty()) {
    response.set_content("", content.type);
    return;
  }
  // Not copied: a GLB has hundreds of megabytes.
  response.set_content_provider(
      content.bytes->size(), content.type,
      [bytes = content.bytes](size_t offset, size_t length, httplib::DataSink& sink) {
        return sink.write(bytes->data() + offset, std::min(length, kBlockBytes));
      });
}

void SetException(httplib::Response& response, const std::exception_ptr& thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const InputError& error) {
    SetError(response, 422, error.what());
  } catch (const UsageError& error) {
    SetError(response, 422, error.what());
  } catch (const std::bad_alloc&) {
    SetError(response, 500, "out of memory");
  } catch (const std::exception& error) {
    SetError(response, 500, std::string("internal error: ") + error.what());
  } catch (...) {
    SetError(response, 500, "internal error of an unknown kind");
  }
}

std::string Literally(const std::string& path) {
  std::string pattern;
  for (const char c : path) {
    if (std::strchr("^$\\.*+?()[]{}|", c) != nullptr) pattern += '\\';
    pattern += c;
  }
  return pattern;
}

bool IsJson(const httplib::Request& request) {
  return BeginsWith(LowerCase(request.get_header_value("Content-Type")), "application/json");
}

LocalServer::Query QueryOf(const httplib::Request& request) {
  LocalServer::Query query;
  for (const auto& [name, value] : request.params) query.emplace(name, value);
  return query;
}

std::optional<Json> ParseBody(const std::string& text) {
  if (text.empty()) return Json::object();
  try {
    return ParseJson(text, "", "");
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace roomtex
