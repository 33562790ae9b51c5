// A component for Unity that draws a body of the world of a SoftWorldBehaviour.
//
// No Unity has run this file. Mono's compiler has compiled it against stubs/UnityEngine.cs, and a test has run it so.
using System;
using System.Runtime.InteropServices;
using UnityEngine;
using UnityEngine.Rendering;

namespace TaichiSoft
{
    /// <summary>Fills the mesh of this game object with a body, once a frame.</summary>
    [RequireComponent(typeof(MeshFilter))]
    public sealed class SoftBodyBehaviour : MonoBehaviour
    {
        [SerializeField, Tooltip("Where the body lives")]
        private SoftWorldBehaviour world = null;

        [SerializeField, Tooltip("The body's name in the world file")]
        private string body = "body0";

        [SerializeField, Tooltip("The mesh's name in the world file; empty for the first one of the body's asset")]
        private string mesh = "";

        private int slot, number;
        private Mesh drawn;
        private Vector3[] vertices, normals;
        private GCHandle vertexMemory, normalMemory; // pinned: the library writes there without a copy
        private bool isSomebody = true;

        /// <summary>The body; ask IsSomebody of it, for a slot may be empty.</summary>
        public Body Body
        {
            get { return world.World.GetBody(slot); }
        }

        private void Start()
        {
            Scene scene = world.Scene;
            slot = scene.Find(NameKind.Body, body);
            number = mesh.Length > 0 ? scene.Find(NameKind.Mesh, mesh) : FirstMesh(scene);
            MeshInfo info = scene.GetMeshInfo(number);
            vertices = new Vector3[info.VertexCount];
            normals = new Vector3[info.VertexCount];
            vertexMemory = GCHandle.Alloc(vertices, GCHandleType.Pinned);
            normalMemory = GCHandle.Alloc(normals, GCHandleType.Pinned);
            drawn = new Mesh { name = body };
            drawn.MarkDynamic();
            drawn.indexFormat = info.VertexCount > 65535 ? IndexFormat.UInt32 : IndexFormat.UInt16;
            drawn.vertices = vertices;
            if (info.HasUv) drawn.uv = UvOf(scene, info);
            var triangles = new int[3 * info.TriangleCount];
            scene.GetTriangles(number, triangles);
            drawn.triangles = triangles;
            GetComponent<MeshFilter>().sharedMesh = drawn;
            // The library says places in the world, and a mesh has them in the game object.
            transform.SetPositionAndRotation(Vector3.zero, Quaternion.identity);
        }

        private int FirstMesh(Scene scene)
        {
            Body found = Body;
            if (!found.IsSomebody)
            {
                throw new SoftException(ErrorCode.State, "nobody lives in " + body + " at first: name the mesh");
            }
            int asset = found.GetAsset(), count = scene.GetInfo().MeshCount;
            for (int i = 0; i < count; ++i)
            {
                if (scene.GetMeshInfo(i).Asset == asset) return i;
            }
            throw new SoftException(ErrorCode.Argument, "nothing is drawn of " + body);
        }

        private Vector2[] UvOf(Scene scene, MeshInfo info)
        {
            var numbers = new float[2 * info.VertexCount];
            scene.GetUv(number, numbers);
            var uv = new Vector2[info.VertexCount];
            for (int i = 0; i < uv.Length; ++i) uv[i] = new Vector2(numbers[2 * i], numbers[2 * i + 1]);
            return uv;
        }

        // After SoftWorldBehaviour.Update, which says how far the picture is.
        private void LateUpdate()
        {
            if (drawn == null || world.World == null) return;
            Body found = Body;
            if (found.IsSomebody)
            {
                found.ReadMesh(
                    number, vertexMemory.AddrOfPinnedObject(), normalMemory.AddrOfPinnedObject(), 3 * vertices.Length);
            }
            else if (isSomebody)
            {
                Array.Clear(vertices, 0, vertices.Length); // triangles without a size: nothing is seen
            }
            else
            {
                return;
            }
            isSomebody = found.IsSomebody;
            drawn.vertices = vertices;
            drawn.normals = normals;
            drawn.RecalculateBounds();
        }

        private void OnDestroy()
        {
            if (vertexMemory.IsAllocated) vertexMemory.Free();
            if (normalMemory.IsAllocated) normalMemory.Free();
            if (drawn != null) Destroy(drawn);
            drawn = null;
        }
    }
}
