// Between the scan frame (numbers for the user, metres) and the page's frame (metres relative to
// the scan's origin, turned so that up is +Y).

import * as THREE from 'three';

export class Frames {
  constructor(scene) {
    this.origin = new THREE.Vector3(...scene.origin);
    this.pageFromScan = new THREE.Quaternion().setFromUnitVectors(
        new THREE.Vector3(...scene.up).normalize(), new THREE.Vector3(0, 1, 0));
    this.scanFromPage = this.pageFromScan.clone().invert();
  }
  toPage(point) {
    return point.clone().sub(this.origin).applyQuaternion(this.pageFromScan);
  }
  toScan(point) {
    return point.clone().applyQuaternion(this.scanFromPage).add(this.origin);
  }
  // Directions.
  turnToScan(direction) {
    return direction.clone().applyQuaternion(this.scanFromPage);
  }

  // A camera of COLMAP (x right, y down, z forward) as one of three.js (y up, z backward).
  cameraRotation(rotationWxyz) {
    const [w, x, y, z] = rotationWxyz;
    const scanFromCam = new THREE.Quaternion(x, y, z, w).invert();
    return this.pageFromScan.clone().multiply(scanFromCam).multiply(kCamFromView);
  }
}
const kCamFromView = new THREE.Quaternion(1, 0, 0, 0);  // half a turn about x
