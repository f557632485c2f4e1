// Sending a file: `fetch` tells nothing of how far it is, XMLHttpRequest does.

import { Refused, understood } from "../api.js";

/**
 * Posts a form to the API; answers the JSON body. `onProgress(share)` hears how much of it is sent, 0 to 1.
 * `signal` of an AbortController ends it. Throws `Refused`.
 */
export function upload(path, form, onProgress = () => {}, signal = null) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `/api/v1/${path}`);
    request.upload.onprogress = ({ loaded, total }) => onProgress(total ? loaded / total : 0);
    request.onload = () => {
      try {
        resolve(understood(request.status, request.responseText));
      } catch (error) {
        reject(error);
      }
    };
    request.onerror = () => reject(new Refused("the connection to the camera broke off", "is it still running?"));
    request.onabort = () => reject(new Refused("the upload was stopped"));
    signal?.addEventListener("abort", () => request.abort());
    request.send(form);
  });
}
