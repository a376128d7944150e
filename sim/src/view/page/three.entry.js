export {
  BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide,
  FrontSide, HemisphereLight, Line, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, PerspectiveCamera, Plane, Raycaster, Scene, ConeGeometry, CylinderGeometry, SphereGeometry, Vector2, Vector3, Quaternion,
  WebGLRenderer,
} from 'three';
export { OrbitControls } from 'three/addons/controls/OrbitControls.js';
