"""Who is answered by the live page, and with which headers."""

import json
import re
import socket

import pytest
from served_page import page as page

from soilml.serve.uploads import LARGEST_FILE


def error_of(answer):
    content = json.loads(answer[2])["error"]
    assert "\n" not in content and content
    return content


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "0.0.0.0", ""]
)
def test_a_foreign_host_is_refused(page, host):
    answer = page.request("GET", "/", Host=host)
    assert answer[0] in (400, 403)
    if answer[0] == 403:
        assert f"answers as 127.0.0.1:{page.port} alone" in error_of(answer)


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
    ids=str,
)
@pytest.mark.parametrize("path", ["/", "/api/choices", "/api/forward", "/static/js/main.js"])
def test_requests_of_other_sites_are_refused(page, path, headers):
    method, body = ("POST", {}) if path == "/api/forward" else ("GET", None)
    answer = page.request(method, path, body, **headers)
    assert answer[0] == 403
    assert "other sites are refused" in error_of(answer)


@pytest.mark.parametrize("kind", ["text/plain", "application/x-www-form-urlencoded", ""])
def test_a_body_that_a_form_could_send_is_refused(page, kind):
    answer = page.request("POST", "/api/forward", b"{}", Content_Type=kind)
    assert answer[0] == 415
    assert "application/json" in error_of(answer)


@pytest.mark.parametrize(
    "path",
    [
        "/static/../command.py",
        "/static/%2e%2e/command.py",
        "/static/js/../../worker.py",
        "/static//etc/passwd",
        "/static/..%2fworker.py",
        "/api/jobs/../../etc/passwd",
        "/api/jobs/" + "0" * 32 + "/..%2f..%2fx",
        "/nothing",
    ],
)
def test_no_path_leads_out_of_the_page(page, path):
    status, headers, body = page.request("GET", path)
    assert status in (403, 404)
    assert "error" in json.loads(body)
    assert "script-src 'self'" in headers["Content-Security-Policy"]


def test_every_answer_has_the_strict_policy(page):
    for path in ("/", "/static/js/main.js", "/api/choices", "/nothing"):
        headers = page.request("GET", path)[1]
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "Server" not in headers and "Access-Control-Allow-Origin" not in headers


def test_the_page_has_no_inline_script_or_style(page):
    text = page.request("GET", "/")[2].decode()
    assert text.count("<script") == 1 and "<style" not in text
    assert " style=" not in text and not re.search(r"\son\w+\s*=", text)
    assert "http://" not in text and "https://" not in text


def test_a_file_that_is_too_large_is_refused_before_it_is_sent(page):
    size = str(LARGEST_FILE + 1)
    answer = page.request(
        "PUT",
        "/api/files?name=log.csv",
        b"",
        Content_Type="application/octet-stream",
        Content_Length=size,
    )
    assert answer[0] == 413
    assert "log.csv has 256 MB; at most 256 MB are accepted" in error_of(answer)


def test_a_number_without_end_is_refused(page):
    for digits in (400, 5000):
        body = b'{"values": {"cohesion": %s}}' % (b"9" * digits)
        answer = page.request("POST", "/api/forward", body)
        assert answer[0] == 422 and error_of(answer) == "cohesion: needed is a number"


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        (("GET", "/static/../../../etc/passwd"), "no file of the page"),
        (("PUT", "/api/files?name=%FF", b"x"), "the request is malformed"),
        (("POST", "/api/forward", b"x"), "the request is malformed"),
        (("POST", "/api/choices", b"{}"), "takes no such request"),
    ],
    ids=str,
)
def test_what_the_server_s_library_refuses_is_no_failure_of_the_server(page, request_, said):
    malformed = {"Content_Type": "multipart/form-data"} if request_[-1] == b"x" else {}
    if request_[0] == "PUT":
        malformed = {"Content_Type": "application/octet-stream"}
    answer = page.request(*request_, **malformed)
    assert 400 <= answer[0] < 500
    assert said in error_of(answer)


def test_it_listens_on_the_loopback_interface_alone(page):
    own = {entry[4][0] for entry in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in own - {"127.0.0.1", "127.0.1.1"}:
        with pytest.raises(OSError):
            socket.create_connection((address, page.port), timeout=5)
    assert page.request("GET", "/")[0] == 200
